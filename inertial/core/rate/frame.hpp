// From samples to states of a products filter: start, standstill, the taking back of unnoticed turns,
// two signs at once, the moving horizon.
//
// A turn begins before the detector sees it. The filter keeps its states of the last 128 samples of
// standstill, every eighth; when a turn is noticed it goes back to where that began and runs those
// samples again as turning. At a start while turning the products give omega but for its sign. The first
// samples are fitted for both (start.cpp), then two filters run, until what they say of omega' and of
// gravity's turn tells the signs apart (E-46).
#pragma once

#include "rate/agreement.hpp"
#include "rate/inexact.hpp"
#include "rate/intake.hpp"
#include "rate/since_rest.hpp"
#include "rate/start.hpp"

namespace gyrofree::rate {

constexpr int EVERY = 8;  // samples between states that are kept
constexpr double UNKNOWN_RATE = 10.0;  // rad/s, sigma before any standstill
constexpr double PROOF_S = 0.8;     // s of turning that axes in use must agree before a turn is believed,
constexpr double DISTRUST_S = 8.0;   // and after a surprise, unless the body stands before
constexpr double DECIDED = 14.0;  // of the balance of two signs: one wrong in a million

// States before some of the newest samples, by the samples' numbers.
template <int Size>
class KeptStates {
 public:
  KeptStates() { clear(); }
  void clear() {
    for (long& number : at_) number = NONE;
  }
  void keep(long sample, const Filter& f) {
    const long k = sample / EVERY % Size;
    states_[k] = f;
    at_[k] = sample;
  }
  const Filter* of(long sample) const {
    if (sample < 0 || sample % EVERY != 0) return nullptr;
    const long k = sample / EVERY % Size;
    return at_[k] == sample ? &states_[k] : nullptr;
  }
  // The one nearest to `wanted` of the newest DEPTH samples up to `now`; its sample, or -1.
  long nearest(long wanted, long now) const {
    long best = NONE;
    for (const long at : at_) {
      if (at < 0 || at > now || now - at >= DEPTH) continue;
      if (best < 0 || std::abs(at - wanted) < std::abs(best - wanted)) best = at;
    }
    return best;
  }

 private:
  static constexpr long NONE = -1;
  Filter states_[Size];
  long at_[Size];
};

// Why nothing that is said is valid.
enum class Doubt : std::uint8_t { NONE, STANDING, CONTRADICTED, NO_DATA, NO_NOISE_MODEL };

// What the frame works by; constant between two changes of the axes in use.
struct Constants {
  Sensor sensor;
  Tuning tuning;
  StillLimits limits;
};

// A tachometer's report: the rate about axis_b at t_s.
struct Report {
  double t_s;
  double rate;   // rad/s
  double sigma;  // rad/s
  bool is_signed;
  Vector3 axis_b;  // of unit length
};

// Axes of which some are not used now, or are used again.
struct Axes {
  bool fewer;                // some are not used any more
  Matrix<MEASURED> T;        // biases become T b
  Matrix<MEASURED> unknown;  // plus what was not known of the axes (E-42)
};

class Frame {
 public:
  // One sample of all axes, m/s^2, read at t_s (s, growing).
  void advance(const Constants& c, double t_s, const double* a);
  // Samples are missing: the next step predicts across.
  void gap();
  // Other axes are in use; configured: with them.
  void exchange_axes(const Constants& configured, const Axes& axes);
  // Correct the state after the newest sample by an older report (E-50). False, and nothing is changed,
  // when it is too old, contradicts by more than 6 sigma, or nothing is known.
  bool correct(const Constants& c, const Report& report);

  // The sensor with the noise that was measured (E-58).
  const Sensor& sensor(const Constants& c) const { return noisier_ ? now_.sensor : c.sensor; }
  Noise& noise() { return watch_.noise(); }
  const Noise& noise() const { return watch_.noise(); }
  const Filter& filter() const { return first_.filter; }
  const Filter& other() const { return second_.filter; }
  const Said& said() const { return said_; }
  Measurement newest() const { return watch_.newest() < 0 ? Measurement(Measurement::Zero()) : watch_.y(watch_.newest()); }
  Doubt doubt() const;
  Intake& intake() { return intake_; }
  const Intake& intake() const { return intake_; }
  bool started() const { return started_; }
  bool still() const { return still_; }
  bool two_signs() const { return branches_ == 2; }
  const Agreement& agreement() const { return agreement_; }
  const Inexact& inexact() const { return inexact_; }
  const Surprise& surprise() const { return surprise_; }
  double balance() const { return balance_; }  // log of the likelihood ratio of the two signs
  double last_s() const { return last_s_; }
  double dt() const { return dt_; }
  long steps() const { return steps_; }
  long refused_products() const { return refused_; }
  long refused_force() const { return refused_force_; }
  long lost() const { return lost_; }

 private:
  const Constants& believed(const Constants& c);
  bool passed_over(const Constants& c, double t_s, const double* a);
  bool settle_start(const Constants& c);
  bool contradicted();
  void trust(double dt);
  void tick(double t_s);
  void restart();
  void wait(const Constants& c, bool still);
  void begin(const Constants& c);
  double fit(const Constants& c);
  void fit_start(const Constants& c, bool still);
  long begin_of_motion(const Constants& c, const Verdict& verdict, long now);
  double late(const Constants& c) const;
  bool on_axis(const Constants& c);
  void free_for_a_while(const Constants& c);
  void run(const Constants& c, long first, long now, bool fixed, const StateVector* end);
  void watch_errors(const Constants& c, long sample, const Moment& moment);
  void horizon(const Constants& c, long now, bool fixed);
  void two_signs(bool still);
  void swap_signs();
  bool diverged();
  void count(const Constants& c);
  void stay();
  void carry_biases(const Axes& axes);
  void from_rest(const Constants& c);

  Watch watch_;
  Constants now_;       // with the noise that was measured, where that is not as configured
  bool noisier_ = false;  // they are in use
  bool renewed_ = true;   // the constants they are made of
  Start first_;
  Start second_;  // of the other sign, while there are two
  KeptStates<DEPTH / EVERY + 1> kept_;
  KeptStates<4> arrivals_;  // of the moving horizon: states before samples of this turn
  Filter before_rest_;   // as it was before the newest standstill
  long rest_from_ = -DEPTH;  // sample that one begins with
  Agreement agreement_;
  Inexact inexact_;
  Surprise surprise_;
  double unproven_s_ = 0.0;  // s of turning without a surprise until what is said of a turn is valid (E-91)
  Intake intake_;
  SinceRest since_rest_;
  bool perhaps_still_ = false;  // a start while turning that may be a standstill with biases
  int perhaps_for_ = 0;         // samples of it
  bool constant_ = false;       // a start while turning in which no reading has changed: an axis may be far off
  double against_s_ = 0.0;      // s in which innovations contradict the filter
  Said said_;
  Said other_said_;
  double last_s_ = std::numeric_limits<double>::quiet_NaN();
  double dt_ = 0.01;
  double balance_ = 0.0;
  bool started_ = false;
  bool still_ = false;
  bool moved_ = false;  // since the first standstill
  int branches_ = 0;    // signs that are followed
  int fitted_ = 0;      // samples of a start while turning that is still being fitted
  int free_for_ = 0;    // samples for which the body is taken to turn freely
  int unused_ = 0;      // samples in a row whose products were refused
  long unlike_ = 0;     // samples in a row whose force was refused
  long refused_ = 0;
  long refused_force_ = 0;
  long taken_back_ = 0;
  long steps_ = 0;
  long lost_ = 0;
};

}  // namespace gyrofree::rate
