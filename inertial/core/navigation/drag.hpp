// The difference of a receiver's position and its integrated velocity, and how it walks off (E-132).
#pragma once

#include "common/matrix.hpp"

namespace gyrofree::navigation {

struct DragFilter {
  static constexpr int OFFSET = 0, DRAG = 3, LAG = 6, STATES = 7;

  Vector<STATES> x = Vector<STATES>::Zero();   // offset (m), drag (m/s), age of the velocity (s); north east up
  Matrix<STATES> P = Matrix<STATES>::Identity();

  // Predicts by dt s with the variances `noise` of offset and drag, corrects by y axis by axis. `speed`
  // is the velocity now less the one at the origin, which the age multiplies; `white` the variance of
  // y. False, and nothing done, when the sum of the squared normalised innovations is above the gate.
  bool look(double dt, const Vector<6>& noise, const Vector3& y, const Vector3& speed, const Vector3& white,
            double gate);
  // Squared drag in its own sigmas (E-133), 3 degrees of freedom.
  double statistic() const;

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("x", s.x), v("P", s.P);
  }
};

}  // namespace gyrofree::navigation
