#include "navigation/drag.hpp"

namespace gyrofree::navigation {
namespace {

constexpr int AXES = 3;

void predict(DragFilter& f, double dt, const Vector<6>& noise) {
  constexpr int DRAG = DragFilter::DRAG;
  f.x.head<AXES>() += dt * f.x.segment<AXES>(DRAG);
  f.P.topRows<AXES>() += dt * f.P.middleRows<AXES>(DRAG);
  f.P.leftCols<AXES>() += dt * f.P.middleCols<AXES>(DRAG);
  f.P.diagonal().head<6>() += noise;
}

// One axis: h picks its offset, and the age times the speed. Returns the squared normalised innovation.
double correct_axis(DragFilter& f, int axis, double y, double speed, double white) {
  constexpr int LAG = DragFilter::LAG;
  const Vector<DragFilter::STATES> Ph = f.P.col(axis) + f.P.col(LAG) * speed;
  const double S = Ph(axis) + Ph(LAG) * speed + white;
  const double e = y - f.x(axis) - f.x(LAG) * speed;
  const Vector<DragFilter::STATES> K = Ph / S;
  f.x += K * e;
  for (int j = 0; j < DragFilter::STATES; ++j) f.P.col(j) -= K * Ph(j);
  return e * e / S;
}

}  // namespace

bool DragFilter::look(double dt, const Vector<6>& noise, const Vector3& y, const Vector3& speed,
                      const Vector3& white, double gate) {
  DragFilter trial = *this;
  predict(trial, dt, noise);
  double nis = 0.0;
  for (int i = 0; i < AXES; ++i) nis += correct_axis(trial, i, y(i), speed(i), white(i));
  if (nis > gate) return false;
  *this = trial;
  return true;
}

double DragFilter::statistic() const {
  const Vector3 drag = x.segment<AXES>(DRAG);
  const Matrix3 covariance = P.block<AXES, AXES>(DRAG, DRAG);
  return square_of(Cholesky<Matrix3>(covariance).whitened(drag));
}

}  // namespace gyrofree::navigation
