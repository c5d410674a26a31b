// Do innovations bear the filter out? Those of a filter that is right are white and of the size it says;
// one that believes a wrong bias or direction is wrong the same way for a while (E-59).
#pragma once

#include <array>

#include "rate/filter.hpp"

namespace gyrofree::rate {

class Agreement {
 public:
  // One sample's correction by m products, dt s after the last.
  void observe(const Said& said, int m, double dt);
  void forget() { *this = Agreement(); }
  // Mean square of innovations averaged over MEAN_S, over what it should be: 1 for a filter that is right.
  double slow() const { return slow_; }
  // NIS per degree of freedom over a second.
  double fast() const { return fast_; }
  // By how much, 1/s, the filter should forget.
  double forgetting() const { return std::max(0.0, RATE * (std::min(slow_, MOST) - SURE)); }

 private:
  static constexpr double MEAN_S = 0.2, OVER_S = 0.5, NIS_S = 1.0;  // s
  static constexpr double SURE = 2.0;   // of slow: by chance once in minutes
  static constexpr double MOST = 20.0;  // of slow that counts
  static constexpr double RATE = 1.0;   // 1/s

  Products mean_ = Products::Zero();
  double slow_ = 1.0;
  double fast_ = 1.0;
};

// Innovations of the products over some samples, by a filter and by axes that are not exact.
struct Heard {
  Products sum = Products::Zero();
  int samples = 0;
  Matrix<PRODUCTS> C = Matrix<PRODUCTS>::Zero();         // of one sample's innovation
  Matrix<PRODUCTS> by_errors = Matrix<PRODUCTS>::Zero();  // the same by errors of the axes of variance 1 (E-90)
};

// Innovations summed over 8 to 64 samples against their covariance and what plausible errors of the axes
// make of them: beyond that, axes are not where they are thought to be, or the rate is not what it is
// thought to be (E-91).
class Surprise {
 public:
  static constexpr double PLAUSIBLE = 0.02 * 0.02;  // of 1, squared: errors of the axes

  void observe(const Heard& heard);
  void forget() { *this = Surprise(); }
  bool beyond() const { return worst_ > LIMIT; }
  bool agrees() const { return worst_ < HALF; }
  double worst() const { return worst_; }

 private:
  static constexpr int KEPT = 8;  // the longest sum
  static constexpr double LIMIT = 45.0;  // chi-square, 6 degrees: by chance once in 2e7

  static constexpr double HALF = 20.0;   // the same, by chance once in 400

  double of_newest(int steps) const;

  std::array<Heard, KEPT> ring_;
  long count_ = 0;
  double worst_ = 0.0;  // of the newest sums
};

}  // namespace gyrofree::rate
