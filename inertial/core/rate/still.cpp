#include "rate/still.hpp"

namespace gyrofree::rate {
namespace {

constexpr int LENGTHS[] = {4, 8, 16, 32, 64, 128};  // samples over which omega' is summed

// The more numbers a layout gives, the less its scatter does by chance.
double scatter_limit(const Sensor& s, const StillLimits& c) {
  constexpr double FULL = 12.0;  // numbers of the layout that the limit is said for
  return 1.0 + (c.spread_limit - 1.0) * std::sqrt(FULL / (6 + s.m));
}

}  // namespace

void Watch::forget() {
  filled = still_for = quiet_for = slow_for = learning = 0;
  gathered.setZero();
}

void Watch::unlearn() {
  forget();
  walk = Drift();
  ring_y.setZero();
  learnt = 0;
}

void Watch::take(const Sensor& s, const double* a, double dt) {
  const Eigen::Index k = count % DEPTH, now = count % TOTALS;
  const Eigen::Index before = (count + TOTALS - 1) % TOTALS;
  ring_dt(k) = dt;
  seconds += dt;
  ring_y.col(k) = s.measure(a);
  if (filled == 0) ring_total.col(before).setZero();
  ring_total.col(now) = ring_y.col(k) + ring_total.col(before);
  ++count;
  ++filled;
  if (filled < DIFFERENCED) return;
  measured.observe(s, third_difference(newest()));
}

bool Watch::rough(const Sensor& s, int n) const {
  constexpr double FAR = 40.0;  // of the mean square of third differences, over noise alone
  for (long last = newest(); last > newest() - n && last - newest() + filled >= DIFFERENCED; --last)
    if (quiet_ratio(s, third_difference(last)) > FAR) return true;
  return false;
}

Measurement Watch::mean_of(int window) const {
  Measurement out = Measurement::Zero();
  for (int ago = 0; ago < window; ++ago) out += y(newest() - ago) / window;
  return out;
}

// Mean square of y about its mean over the window, over its noise (E-20); running sums, made anew now
// and then.
double Watch::scatter(const Sensor& s, int window) {
  const Measurement now = y(newest());
  if (filled == window || count % DEPTH == 0) {
    offset = now;
    sum.setZero();
    sum_of_squares.setZero();
    for (int ago = 0; ago < window; ++ago) {
      const Measurement d = y(newest() - ago) - offset;
      sum += d;
      sum_of_squares += d.cwiseProduct(d);
    }
  } else {
    const Measurement come = now - offset, gone = y(newest() - window) - offset;
    sum += come - gone;
    sum_of_squares += come.cwiseProduct(come) - gone.cwiseProduct(gone);
  }
  const Measurement total = sum_of_squares - sum.cwiseProduct(sum) / window;
  double ratio = 0.0;
  for (int k = 0; k < 3; ++k) ratio += total(ALPHA_M + k) / s.R_alpha(k, k) + total(FORCE_M + k) / s.R_p(k, k);
  for (int k = 0; k < s.m; ++k) ratio += total(PRODUCTS_M + k) / s.R_c(k, k);
  return ratio / ((window - 1) * (6 + s.m));
}

// Mean y over the window that ended `ago` samples ago.
Measurement Watch::mean(int window, int ago) const {
  const long last = newest() - ago;
  if (filled <= window + ago) return total(last) / window;
  return (total(last) - total(last - window)) / window;
}

// Variance of one axis by scale errors, of a body that stands another way up by d.
double Watch::leant(const Sensor&, const StillLimits& c, const Measurement& d) const {
  return square(c.scale) * square_of(Vector3(d.segment<3>(FORCE_M)));
}

// Chi-square of the mean [omega', c] of the window against the reference (E-21).
double Watch::moved(const Sensor& s, const StillLimits& c, int window) const {
  const double share = 1.0 / window + 1.0 / learnt;
  const Measurement all = mean(window) - reference;
  // over the variance of one sample of an axis
  const double since = seconds - settled_s;
  const double walked = (leant(s, c, all) + walk.variance() * since * since) / s.axis_variance();
  double chi2 = 0.0;
  for (int k = 0; k < s.spread.size(); ++k) {
    double along = 0.0;
    for (int r = 0; r < PRODUCTS_M + s.m; ++r) along += s.basis(k, r) * all(r);
    chi2 += along * along / (s.spread(k) * (share + walked) + c.drift * c.drift);
  }
  return chi2;
}

// Chi-square of the sum of omega' over the newest samples against the bias of this standstill (E-23).
double Watch::turned(const Sensor& s, int length, double drift) const {
  const double share = length * (1.0 + static_cast<double>(length) / learnt);
  const Measurement d = total(newest()) - total(newest() - length) - length * reference;
  const double late = (0.5 * learnt + length) * dt(newest());  // s, by which the reference lags behind
  double chi2 = 0.0;
  for (int r = 0; r < 3; ++r) chi2 += square(d(ALPHA_M + r)) / (s.R_alpha(r, r) * share + square(length) * (drift * drift + late * late * walk.variance() * s.drift(r, r)));
  return chi2;
}

// Chi-square of the mean p of the window against that of this standstill (E-24).
double Watch::tilted(const Sensor& s, int window, double drift) const {
  const double share = 1.0 / window + 1.0 / learnt;
  const Measurement d = mean(window) - reference;
  double chi2 = 0.0;
  for (int r = 0; r < 3; ++r) chi2 += square(d(FORCE_M + r)) / (s.R_p(r, r) * share + drift * drift);
  return chi2;
}

// Chi-square of the mean p of the window against that of `span` samples ago, which must be there (E-24).
double Watch::swung(const Sensor& s, const StillLimits& c, int span) const {
  const Measurement d = mean(c.window) - mean(c.window, span);
  double chi2 = 0.0;
  for (int r = 0; r < 3; ++r)
    chi2 += square(d(FORCE_M + r)) / (s.R_p(r, r) * 2.0 / c.window + square(c.drift_steady));
  return chi2;
}

// Has gravity kept its direction for as long as the caller's rate leaves in doubt (E-25)? told:
// chi-square of a rate of zero.
bool Watch::settled(const Sensor& s, const StillLimits& c, const Vector3& omega, const Matrix3& P,
                    double told) const {
  const double most = norm_of(omega) + 2.0 * std::sqrt(largest_variance(P));
  if (learnt > 0 && most < c.sure_rate) return true;
  const int span = learnt > 0 && most <= c.likely_rate ? c.brief_span : c.steady_span;
  if (filled < span + c.window) return false;
  const double swing = swung(s, c, span);
  return swing <= c.steady_limit && (told >= c.rate_limit || told + swing < c.begin_limit);
}

double rate_excludes_zero(const Vector3& omega, const Matrix3& P, double slack) {
  const Cholesky<Matrix3> factor(P + slack * slack * Matrix3::Identity());
  return square_of(factor.whitened(omega));
}

// 0 while a standing body stands on; else how many samples ago it began to move (E-23, E-24).
int Watch::began(const Sensor& s, const StillLimits& c) const {
  if (learning < c.window) return 0;
  double worst = 1.0;
  int depth = 0;
  for (const int length : LENGTHS) {
    if (length >= std::min(still_for, filled - 1)) break;
    const double ratio = turned(s, length, c.drift_now) / c.turn_limit;
    if (ratio > worst) {
      worst = ratio;
      depth = length + length / 2;
    }
  }
  if (depth == 0 && tilted(s, c.window, c.drift_tilt) > c.tilt_limit) depth = c.guard;
  return std::min(depth, DEPTH - 8);
}

// One more sample of standstill; the one `guard` samples ago becomes part of the reference.
void Watch::learn(const Sensor& s, const StillLimits& c) {
  ++still_for;
  if (still_for == 1) {  // what was asked before it was believed stood as well
    walk.begin();
    const int before = learnt > 0 ? c.window : c.steady_span;
    double ago = before * dt(newest());
    for (int k = before; k > 0; --k, ago -= dt(newest())) walk.learn(s, y(newest() - k), seconds - ago);
  }
  if (still_for <= c.guard) return;
  ++learning;
  const Measurement late = y(newest() - c.guard);
  gathered += late;
  walk.learn(s, late, seconds - c.guard * dt(newest()));
  if (learning < c.window) return;
  if (learning == c.window && learnt > 0) {
    const Measurement d = gathered / learning - reference;
    walk.moved(s, d, s.axis_variance() * (1.0 / learning + 1.0 / learnt) + leant(s, c, d), seconds - settled_s);
  }
  settled_s = seconds;
  learnt = learning;
  reference = gathered / learning;
}

bool Watch::restless() {
  quiet_for = slow_for = 0;
  return false;
}

bool Watch::stands(const Sensor& s, const StillLimits& c, const Vector3& omega, const Matrix3& P, double dt) {
  if (hold > 0) --hold;
  if (filled < c.window || scatter(s, c.window) > scatter_limit(s, c) || hold > 0)
    return restless();
  const double told = rate_excludes_zero(omega, P, c.rate_slack);
  const bool slow = told < c.rate_limit;
  told_otherwise = !slow;
  if (!settled(s, c, omega, P, told)) return restless();
  if (learnt == 0 || (moved(s, c, c.window) <= c.quiet_limit &&
                      moved(s, c, c.short_window) <= c.quiet_limit)) {
    ++quiet_for;
    slow_for = 0;
    return slow || quiet_for * dt >= c.patience_s;
  }
  quiet_for = 0;
  slow_for = slow ? slow_for + 1 : 0;
  return slow_for * dt >= 2.0 * c.patience_s;
}

// Nothing that its axes say denies it: they scatter by noise, gravity keeps its direction, and biases
// explain the rest.
bool Watch::could_stand(const Sensor& s, const StillLimits& c, double bias) {
  constexpr double BIASES_EXPLAIN = 25.0;  // chi-square, 9 degrees of which biases leave one each
  if (filled < c.window) return true;
  if (scatter(s, c.window) > scatter_limit(s, c)) return false;
  const int span = std::min(c.steady_span, filled - c.window);
  if (span > 0 && swung(s, c, span) > c.steady_limit) return false;
  const Measurement all = mean(c.window);
  double chi2 = 0.0;
  for (int k = 0; k < PRODUCTS_M + s.m; ++k) chi2 += all(k) * all(k) / ((bias + s.axis_variance() / c.window) * s.drift(k, k));
  return chi2 < BIASES_EXPLAIN;
}

Verdict Watch::detect(const Sensor& s, const StillLimits& c, const Vector3& omega, const Matrix3& P, double dt) {
  const bool standing = still_for > 0;
  const bool still = stands(s, c, omega, P, dt);
  int depth = standing ? began(s, c) : 0;
  if (still && depth == 0) {
    learn(s, c);
    return {true, 0, told_otherwise};
  }
  if (standing && depth == 0) depth = std::min({std::max(depth, 2 * c.window), still_for, DEPTH - 8});
  still_for = learning = 0;
  gathered.setZero();
  if (standing) {
    quiet_for = 0;
    hold = c.hold;
  }
  return {false, depth};
}

}  // namespace gyrofree::rate
