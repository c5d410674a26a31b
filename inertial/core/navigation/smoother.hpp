// All fixes for every moment of a drive: Rauch, Tung and Striebel's smoother (E-126). The forward pass
// is a filter; each fix, used or not, and each constraint that held is an event. Going back, the error
// left in the filter's own solution is found and taken off.
#pragma once

#include <span>
#include <vector>

#include "navigation/filter.hpp"

namespace gyrofree::navigation {

// The smoothed solution at a fix.
struct Smoothed {
  Vector<MOST_ROWS> left;   // smoothed - measured, rows as of `compared`
  Nominal x;
  Eigen::Matrix<double, MOVING, MOVING, Eigen::RowMajor> P;  // of attitude, velocity, position

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("left", s.left), v("x", s.x), v("P", s.P);
  }
};

// Filters samples start..stop-1 with all fixes among them, then smooths; one result per fix.
std::vector<Smoothed> smooth(Leg leg, const Model& model, const Settings& settings, Memory memory,
                             Samples samples, std::size_t start, std::size_t stop, std::span<const Fix> fixes);

}  // namespace gyrofree::navigation
