// Corrections of the products filter: products, gravity, standstill (E-33 to E-38).
#include "rate/filter.hpp"

namespace gyrofree::rate {
namespace {

// Mean that the spread of omega adds to its products (E-34).
Products spread_mean(const Matrix3& P) {
  Products mean;
  for (int k = 0; k < PRODUCTS; ++k) mean(k) = P(FIRST[k], SECOND[k]);
  return mean;
}

}  // namespace

Matrix<PRODUCTS> spread_covariance(const Matrix3& P) {
  Matrix<PRODUCTS> S;
  for (int a = 0; a < PRODUCTS; ++a) {
    const int i = FIRST[a], j = SECOND[a];
    for (int b = 0; b <= a; ++b) {
      const int k = FIRST[b], l = SECOND[b];
      S(a, b) = S(b, a) = P(i, k) * P(j, l) + P(i, l) * P(j, k);
    }
  }
  return S;
}

ForceModel force_model(const StateVector& x, const Vector3& alpha, const Sensor& s) {
  const Vector3 omega = x.segment<3>(OMEGA), r = x.segment<3>(PIVOT);
  ForceModel h;
  h.by_omega = omega * r.transpose() - 2.0 * r * omega.transpose() + dot(omega, r) * Matrix3::Identity();
  if (s.feedback) h.by_omega += product(s.SQ_force, squares_jacobian(omega));
  h.by_pivot = omega * omega.transpose() - square_of(omega) * Matrix3::Identity() + skew(alpha);
  return h;
}

Vector3 measured_force(const StateVector& x, const ForceModel& h, const Sensor& s) {
  Vector3 p = x.segment<3>(LIFT) + x.segment<3>(BIAS_FORCE) + h.by_pivot * x.segment<3>(PIVOT);
  if (s.feedback) p += product(s.SQ_force, squares(x.segment<3>(OMEGA)));
  return p;
}

Matrix<PRODUCTS, 3> products_model(const Vector3& omega, const Sensor& s) {
  const Matrix<PRODUCTS, 3> D = squares_jacobian(omega);
  return s.plain ? D : product(s.M, D);
}

Seen<6> see_products(const Covariance& P, const Vector3& at, const Sensor& s, double share) {
  Seen<6> seen;
  const Matrix<PRODUCTS, 3> H = products_model(at, s);
  seen.PHt = P.middleCols<6>(BIAS_PRODUCTS) + columns_by(P.middleCols<3>(OMEGA), H);
  seen.C = seen.PHt.middleRows<6>(BIAS_PRODUCTS) + product(H, seen.PHt.middleRows<3>(OMEGA)) + share * s.R_c;
  return seen;
}

Likelihood by_products(Filter& f, const Products& c_m, const Vector3& at, const Sensor& s, const Tuning& t,
                       Said& said) {
  if (s.m == 0) return {};
  const Matrix3 P = f.omega_covariance();
  Products z = product(squares_jacobian(at), f.omega()) - squares(at) + spread_mean(P);
  Seen<6> seen = see_products(f.P, at, s, 1.0);
  if (s.plain) {
    seen.C += spread_covariance(P);
  } else {
    z = product(s.M, z);
    seen.C += product_transposed(product(s.M, spread_covariance(P)), s.M);
  }
  seen.y = c_m - f.x.segment<6>(BIAS_PRODUCTS) - z;
  for (int r = 0; r < s.m; ++r) {
    said.innovation(r) = seen.y(r);
    said.sigma(r) = std::sqrt(seen.C(r, r));
  }
  return absorb(f.x, f.P, seen, t.products_gate);
}

Seen<3> see_force(const StateVector& x, const Covariance& P, const Vector3& p, const Vector3& alpha,
                  const Sensor& s, double share) {
  const ForceModel h = force_model(x, alpha, s);
  Seen<3> seen;
  seen.PHt = P.middleCols<3>(LIFT) + P.middleCols<3>(BIAS_FORCE) +
             columns_by(P.middleCols<3>(OMEGA), h.by_omega) +
             columns_by(P.middleCols<3>(PIVOT), h.by_pivot);
  seen.C = seen.PHt.middleRows<3>(LIFT) + seen.PHt.middleRows<3>(BIAS_FORCE) +
           h.by_omega * seen.PHt.middleRows<3>(OMEGA) + h.by_pivot * seen.PHt.middleRows<3>(PIVOT) +
           share * s.R_p;
  seen.y = p - measured_force(x, h, s);
  return seen;
}

// alpha: omega' of this sample; late: its mean before. The Jacobian is that of `late`: alpha's noise in
// it would seem to say that the centre, which does not follow it, is on the axis.
Likelihood by_force(Filter& f, const Vector3& p, Vector3 alpha, Vector3 late, bool turning, const Sensor& s,
                    const Tuning& t) {
  if (!turning) {  // omega' is noise: it must not seem to measure the pivot
    alpha.setZero();
    late.setZero();
  }
  Seen<3> seen = see_force(f.x, f.P, p, late, s, 1.0);
  if (turning) {
    const Vector3 r = f.x.segment<3>(PIVOT), news = alpha - late;
    seen.y -= skew(news) * r;
    const double doubt = trace(f.P.block<3, 3>(PIVOT, PIVOT));
    const double noise = (square_of(r) + doubt) * s.R_alpha(0, 0) + doubt * square_of(news);
    for (int k = 0; k < 3; ++k) seen.C(k, k) += t.centre + noise;
  }
  return absorb(f.x, f.P, seen, t.force_gate);
}

Seen<6> see_standstill(const Covariance& P, const Sensor& s, double rate, double share) {
  Seen<6> seen;
  seen.PHt = P.middleCols<6>(OMEGA);
  seen.C = seen.PHt.middleRows<6>(OMEGA);
  for (int i = 0; i < 3; ++i) seen.C(i, i) += rate;
  seen.C.block<3, 3>(BIAS_ALPHA, BIAS_ALPHA) += share * s.R_alpha;
  return seen;
}

// omega is the Earth's and omega' is bias (E-38).
void by_standstill(Filter& f, const Vector3& alpha_m, const Vector3& earth_b, const Sensor& s, const Tuning& t) {
  Seen<6> seen = see_standstill(f.P, s, t.still_rate, 1.0);
  seen.y.head<3>() = earth_b - f.omega();
  seen.y.tail<3>() = alpha_m - f.x.segment<3>(BIAS_ALPHA);
  absorb(f.x, f.P, seen, std::numeric_limits<double>::infinity());
}

}  // namespace gyrofree::rate
