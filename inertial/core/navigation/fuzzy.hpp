// The fuzzy horizon: how hard the vehicle moves decides how many fixes are looked back (E-128, E-129).
#pragma once

#include <array>

#include "common/matrix.hpp"

namespace gyrofree::navigation {

struct FuzzyRules {
  Vector3 force = Vector3::Zero();    // break points of the sets S, M, H, m/s^2
  Vector3 rate = Vector3::Zero();     // rad/s
  Matrix3 table = Matrix3::Zero();    // consequents, rows by force, columns by rate
  bool minimum = false;               // combine sets by their minimum instead of their product

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("force", s.force), v("rate", s.rate), v("table", s.table), v("minimum", s.minimum);
  }
};

// S, M, H of a value: a partition of unity over three break points.
Vector3 membership(double value, const Vector3& points);
// 1 + No, not yet rounded, from |f| and |omega| (E-129).
double crisp_horizon(double force, double rate, const FuzzyRules& rules);
// N: the horizon rounded half up, 2 to 10 fixes (E-129).
int whole_horizon(double crisp);

}  // namespace gyrofree::navigation
