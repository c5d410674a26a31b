// A filter on samples that come one by one. A fix arrives after the samples of its instant: the
// filter as it was after the last fix used (or two seconds ago), the anchor, is kept beside the newest
// state, the head. A fix goes back to the anchor, corrects at its own time and runs forward again.
#pragma once

#include "navigation/filter.hpp"

namespace gyrofree::navigation {

constexpr double LATEST_S = 2.0;       // that a fix may be late
constexpr double ANCHOR_STEP_S = 1.0;  // by which the anchor follows, for speed
constexpr std::size_t MOST_SAMPLES = 8192;  // kept before navigation; at 1 kHz 8 s
constexpr std::size_t KEPT_SAMPLES = 4096;  // of them when there are more

struct Live {
  Model model;
  Settings settings;
  Memory memory;
  bool navigating = false;
  Leg anchor, head;
  std::vector<Sample> history;
  std::size_t anchor_next = 0, head_next = 0;  // first samples not used up

  // Keeps samples, whose times rise, and steps the filter once it navigates.
  void feed(Samples samples);
  // Starts the filter with a leg at the time of a fix.
  void begin(const Leg& leg, const Memory& start);
  // Ends navigation and forgets all samples.
  void stop();
  // True when a fix of time t can be applied no more.
  bool too_late(double t) const;
  // Judges and applies a fix.
  FixResult take(const Fix& fix);

  double newest() const { return history.empty() ? -FOREVER : history.back().t; }
  // The samples kept begin at or before t.
  bool reaches(double t) const { return !history.empty() && history.front().t <= t; }
  // C_nb at time t, the newest one turned back by the gyro.
  Matrix3 turned_back(const Matrix3& C_nb, const Vector3& bias_gyro, double t) const;

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("model", s.model), v("settings", s.settings), v("memory", s.memory), v("navigating", s.navigating);
    v("anchor", s.anchor), v("head", s.head), v("history", s.history);
    v("anchor_next", s.anchor_next), v("head_next", s.head_next);
  }

 private:
  void keep(const Sample& sample);
  void drop(std::size_t count);
  void follow();
  std::size_t after(double t) const;
};

}  // namespace gyrofree::navigation
