#include "rate/frame.hpp"

namespace gyrofree::rate {
namespace {

constexpr double LONGEST_GAP_S = 0.5;  // after a longer one the rate is unknown
constexpr int WINDOW = 24;             // samples of the moving horizon
constexpr int ITERATIONS = 2;          // of Gauss and Newton
constexpr int ALWAYS_UNLIKE = 50;      // samples in a row without gravity: u and the pivot are found anew
constexpr double FASTEST = 120.0;      // rad/s, twice what +-16 g allow at 5 cm of the axis
constexpr int FREE_FOR = 200;          // samples
constexpr double FEW_SAY_AT_MOST = 2.0;  // of the balance, by a fit of few samples

// omega that many samples before one with state `end`, by what was measured of omega' since (E-49).
Vector3 back(const StateVector& end, const Measurement& now, const Measurement& then, long samples, double dt,
             const Sensor& s) {
  Vector3 gained = (now - then).segment<3>(ALPHA_M) - samples * end.segment<3>(BIAS_ALPHA);
  if (s.feedback) gained -= samples * product(s.SQ_alpha, squares(end.segment<3>(OMEGA)));
  return end.segment<3>(OMEGA) - dt * gained;
}

}  // namespace

void Frame::gap() {
  watch_.forget();
  kept_.clear();
  arrivals_.clear();
  fitted_ = 0;
}

// The rate is unknown: wait for a standstill, or start while turning.
void Frame::restart() {
  gap();
  since_rest_.forget();
  started_ = still_ = moved_ = constant_ = false;
  agreement_.forget();
  surprise_.forget();
  inexact_.begin_anew();
  perhaps_still_ = false;
  perhaps_for_ = 0;
  against_s_ = 0.0;
  branches_ = 0;
  first_.filter = Filter();
}

void Frame::tick(double t_s) {
  const double dt = t_s - last_s_;
  last_s_ = t_s;
  if (dt > LONGEST_GAP_S) {
    restart();
  } else if (dt > 0.0) {
    dt_ = dt;
  }
  ++steps_;
}

// The constants with the noise that was measured.
const Constants& Frame::believed(const Constants& c) {
  noisier_ = !watch_.noise().as_configured();
  if (!noisier_) return c;
  if (renewed_) now_ = c;
  renewed_ = false;
  apply(watch_.noise(), c.sensor, now_.sensor);
  return now_;
}

void Frame::advance(const Constants& configured, double t_s, const double* a) {
  if (passed_over(configured, t_s, a)) return;
  tick(t_s);
  watch_.noise().rounded(intake_.resolution(configured.sensor), configured.sensor);
  since_rest_.take(configured.sensor, a, dt_, started_ && still_, first_.filter);
  watch_.take(configured.sensor, a, dt_);
  const Constants& c = believed(configured);
  said_ = Said();
  Filter& f = first_.filter;
  if (!started_)
    for (int i = 0; i < 3; ++i) f.P(OMEGA + i, OMEGA + i) = UNKNOWN_RATE * UNKNOWN_RATE;
  const Verdict verdict = watch_.detect(c.sensor, c.limits, f.omega(), f.omega_covariance(), dt_);
  if (!started_) return wait(c, verdict.still);
  if (settle_start(c)) return;
  if (fitted_ > 0) {
    still_ = verdict.still;
    fit_start(c, verdict.still);
    diverged();
    return;
  }
  const long now = watch_.newest();
  const long first = begin_of_motion(c, verdict, now);
  if (verdict.against && !still_) {  // the rate was wrong, and so is what it was made of
    begin(c);
    rest_from_ = -DEPTH;
  }
  still_ = verdict.still;
  const bool fixed = !still_ && on_axis(c);
  if (still_) arrivals_.clear();
  run(c, first, now, fixed, nullptr);
  if (static_cast<Method>(c.tuning.method) == Method::HORIZON && !still_) horizon(c, now, fixed);
  if (branches_ == 2) two_signs(still_);
  if (diverged()) return;
  trust(dt_);
  if (still_ && !moved_) stay();
  count(c);
  if (contradicted()) restart();
}

// Samples that say nothing: a few are bridged, after more the rate is unknown.
bool Frame::passed_over(const Constants& c, double t_s, const double* a) {
  if (!intake_.refuses(c.sensor, a, dt_, watch_.noise().any())) return false;
  said_ = Said();
  still_ = still_ && intake_.missing() <= BRIDGED_SAMPLES;
  if (intake_.missing() == BRIDGED_SAMPLES + 1) restart();
  if (intake_.missing() > BRIDGED_SAMPLES) last_s_ = t_s;
  return true;
}

// A start while turning that never moved: biases looked like a rate. True when it is taken for a
// standstill now.
bool Frame::settle_start(const Constants& c) {
  constexpr int BELIEVED = 100;  // samples in which nothing denies a standstill, the first second not counted
  constexpr double FAR_OFF = 9.0;  // times the variance of a bias: axes have been seen that are so far off
  constant_ = constant_ && watch_.never_stood() && watch_.could_stand(c.sensor, c.limits, FAR_OFF * c.tuning.bias);
  perhaps_still_ = branches_ == 2 && watch_.never_stood() && watch_.could_stand(c.sensor, c.limits, c.tuning.bias);
  perhaps_for_ = perhaps_still_ ? perhaps_for_ + 1 : 0;
  if (perhaps_for_ < c.limits.steady_span + c.limits.window + BELIEVED) return false;
  begin(c);
  still_ = true;
  moved_ = perhaps_still_ = false;
  fitted_ = perhaps_for_ = 0;
  return true;
}

// A body that stands is known not to turn. One that turns is believed once its innovations have borne out
// the axes in use for a while (E-91).
void Frame::trust(double dt) {
  if (still_) {
    unproven_s_ = std::min(unproven_s_, PROOF_S);
  } else if (branches_ == 1 && surprise_.agrees()) {
    unproven_s_ = std::max(0.0, unproven_s_ - dt);
  }
  if (surprise_.beyond()) unproven_s_ = DISTRUST_S;
}

// Innovations beyond their size for seconds: what was believed is not worth correcting.
bool Frame::contradicted() {
  constexpr double FAR = 2.0;       // of NIS per degree of freedom, over a second
  constexpr double PATIENCE_S = 3.0;  // s
  constexpr int NOT_DAMAGE = 10;      // samples in a row that the products of omega refuse
  unused_ = said_.used ? 0 : unused_ + 1;
  against_s_ = agreement_.fast() > FAR ? against_s_ + dt_ : 0.0;
  if (unused_ > BRIDGED_SAMPLES || against_s_ > 0.0) unproven_s_ = DISTRUST_S;
  if (against_s_ < PATIENCE_S && unused_ < NOT_DAMAGE) return false;
  unused_ = 0;
  ++lost_;
  return true;
}

Doubt Frame::doubt() const {
  if (intake_.missing() > 0) return Doubt::NO_DATA;
  if (perhaps_still_ || constant_) return Doubt::STANDING;
  const bool unproven = unproven_s_ > 0.0 && started_ && !still_;
  const bool beyond = against_s_ > 0.0 || surprise_.beyond();
  return unproven || beyond || intake_.doubted() ? Doubt::CONTRADICTED : Doubt::NONE;
}

void Frame::wait(const Constants& c, bool still) {
  still_ = still;
  if (still) {
    begin(c);
  } else if (turns(watch_, c.sensor, c.tuning)) {
    started_ = moved_ = constant_ = true;
    branches_ = 2;
    fitted_ = FEWEST;
    balance_ = fit(c);
  }
}

void Frame::begin(const Constants& c) {
  inexact_.begin_anew();
  surprise_.forget();
  begin_still(first_.filter, c.sensor, c.tuning, watch_.mean_of(c.limits.window));
  started_ = true;
  constant_ = false;
  branches_ = 1;
}

// Both signs anew; how much likelier the first is. By few samples that is not known well.
double Frame::fit(const Constants& c) {
  const double ratio = begin_turning(first_, second_, watch_, c.sensor, c.tuning, fitted_);
  return fitted_ >= SURE_FROM ? ratio : std::min(ratio, FEW_SAY_AT_MOST);
}

// One more sample of a start while turning: fitted anew now and then, carried on between (E-46).
void Frame::fit_start(const Constants& c, bool still) {
  const int n = ++fitted_;
  if (watch_.rough(c.sensor, 1)) return restart();  // a damaged sample
  if (still) {  // it was no turn
    begin(c);
    moved_ = false;
    fitted_ = 0;
  } else if (std::find(std::begin(FITS), std::end(FITS), n) != std::end(FITS)) {
    balance_ = fit(c);
    branches_ = balance_ > DECIDED && !perhaps_still_ ? 1 : 2;
  } else {
    const long now = watch_.newest();
    for (Start* begun : {&first_, &second_}) carry(begun->filter, watch_.y(now), watch_.dt(now), c.sensor, c.tuning);
  }
  if (n >= MOST) {  // from here a filter, that does not know yet whether the axis is fixed
    fitted_ = 0;
    free_for_ = FREE_FOR;
  }
}

// First sample to run: the newest one, or where a turn began that is noticed now.
long Frame::begin_of_motion(const Constants& c, const Verdict& verdict, long now) {
  if (verdict.still) {
    if (!still_) {
      before_rest_ = first_.filter;
      rest_from_ = now;
    }
    if (now % EVERY == 0) kept_.keep(now, first_.filter);
    return now;
  }
  if (!still_) return now;
  moved_ = true;
  long first = kept_.nearest(now - verdict.depth, now);
  if (now - rest_from_ < DEPTH - EVERY && branches_ == 1) {  // so short that it was none
    first = rest_from_;
    first_.filter = before_rest_;
  } else if (first >= 0) {
    first_.filter = *kept_.of(first);
  }
  if (first >= 0) {
    taken_back_ += now - first;
    inexact_.jumped(first_.filter);
  }
  kept_.clear();
  if (noisier_) first_.filter.P.block<3, 3>(OMEGA, OMEGA) += late(c) * Matrix3::Identity();
  return first >= 0 ? first : now;
}

// A turn is noticed the later the more the axes scatter.
double Frame::late(const Constants& c) const {
  return c.tuning.unseen_rate * (watch_.noise().unnoticed() - 1.0);
}

// Does omega keep its direction? Not while omega' across it, summed over 16 or 64 samples, is more than
// noise. A body found to turn freely is taken for one for a while, and omega's variance across grows
// (E-45).
bool Frame::on_axis(const Constants& c) {
  Filter& f = first_.filter;
  const double square = f.speed_squared();
  if (c.tuning.axis == 0.0 || square <= c.tuning.axis_from) return false;
  const Vector3 omega = f.omega();
  for (const int length : {16, 64}) {
    if (watch_.filled_samples() <= length) break;
    const Measurement sum = watch_.total(watch_.newest()) - watch_.total(watch_.newest() - length);
    const Vector3 gained = sum.segment<3>(ALPHA_M) - length * f.x.segment<3>(BIAS_ALPHA);
    const double along = dot(gained, omega);
    const double across = square_of(gained) - along * along / square;
    if (across > c.tuning.axis_limit * length * c.sensor.R_alpha(0, 0) && free_for_ < FREE_FOR) free_for_a_while(c);
  }
  if (free_for_ > 0) --free_for_;
  return free_for_ == 0;
}

void Frame::free_for_a_while(const Constants& c) {
  if (free_for_ == 0) first_.filter.P.block<3, 3>(OMEGA, OMEGA) += c.tuning.axis_lost * Matrix3::Identity();
  free_for_ = FREE_FOR;
}

// Samples first to now through the filter of each sign. end: the products are linear about what omega
// was by that state of the newest sample.
void Frame::run(const Constants& c, long first, long now, bool fixed, const StateVector* end) {
  const bool keeps = static_cast<Method>(c.tuning.method) == Method::HORIZON && !still_;
  for (long sample = first; sample <= now; ++sample) {
    const bool eighth = sample % EVERY == 0;
    if (eighth && keeps) arrivals_.keep(sample, first_.filter);
    Vector3 at;
    if (end != nullptr) at = back(*end, watch_.total(now), watch_.total(sample), now - sample, dt_, c.sensor);
    const Moment moment{watch_.dt(sample), !still_, fixed, eighth ? EVERY * dt_ : 0.0, end == nullptr ? nullptr : &at,
                        agreement_.forgetting(), watch_.wander(), eighth ? intake_.resolution(c.sensor) : 0.0};
    step(first_.filter, c.sensor, c.tuning, watch_.y(sample), moment, said_);
    if (end == nullptr) watch_errors(c, sample, moment);
    if (branches_ == 2) step(second_.filter, c.sensor, c.tuning, watch_.y(sample), moment, other_said_);
  }
}

// What errors of the axes do to the state after a sample.
void Frame::watch_errors(const Constants& c, long sample, const Moment& moment) {
  if (branches_ == 1) inexact_.observe(said_);
  if (moment.grow == 0.0) return;
  const Measurement mean = (watch_.total(sample) - watch_.total(sample - EVERY)) / EVERY;
  inexact_.step(first_.filter, c.sensor, c.tuning, {mean, dt_, EVERY, moment.turning, moment.fixed});
  if (branches_ != 1) return;
  Heard heard = inexact_.heard();
  const double rounding = square(intake_.resolution(c.sensor)) / 6.0;  // it lasts as long as readings stay equal
  heard.by_errors += rounding / Surprise::PLAUSIBLE * c.sensor.drift.block<PRODUCTS, PRODUCTS>(PRODUCTS_M, PRODUCTS_M);
  surprise_.observe(heard);
}

// The window again, about what its end says, when it is due and all of it was turning (E-49).
void Frame::horizon(const Constants& c, long now, bool fixed) {
  if (branches_ != 1) return;
  const long first = now + 1 - WINDOW;
  for (int iteration = 0; iteration < ITERATIONS; ++iteration) {
    const Filter* arrival = arrivals_.of(first);
    if (arrival == nullptr) return;
    const StateVector end = first_.filter.x;
    first_.filter = *arrival;
    run(c, first, now, fixed, &end);
  }
}

void Frame::swap_signs() {
  std::swap(first_.filter, second_.filter);
  inexact_.begin_anew();  // what errors of the axes do to one is not what they do to the other
  balance_ = -balance_;
}

// Keep the better one of two signs first, and only that once it is sure.
void Frame::two_signs(bool still) {
  balance_ += elementary::log(said_.density / other_said_.density) - 0.5 * (said_.misfit - other_said_.misfit);
  if (balance_ < 0.0) {
    swap_signs();
    std::swap(said_, other_said_);
  }
  if (still || (balance_ > DECIDED && !perhaps_still_)) branches_ = 1;
}

// Start anew when the rate is beyond all bounds or no number at all, or its covariance is none any more.
bool Frame::diverged() {
  const Filter& f = first_.filter;
  const Matrix3 P = f.omega_covariance();
  if (f.speed_squared() < FASTEST * FASTEST && P(0, 0) > 0.0 && P(1, 1) > 0.0 && P(2, 2) > 0.0) return false;
  ++lost_;
  unproven_s_ = DISTRUST_S;
  restart();
  said_ = Said();
  return true;
}

// Position and angle count from the end of the first standstill.
void Frame::stay() {
  Filter& f = first_.filter;
  f.v_n.setZero();
  f.p_n.setZero();
  f.x(ANGLE) = 0.0;
  f.P.row(ANGLE).setZero();
  f.P.col(ANGLE).setZero();
}

void Frame::count(const Constants& c) {
  agreement_.observe(said_, c.sensor.m, dt_);
  if (!said_.used) ++refused_;
  if (said_.force_used) {
    unlike_ = 0;
    return;
  }
  ++refused_force_;
  ++unlike_;
  if (unlike_ % ALWAYS_UNLIKE != 0) return;
  // not one bump: gravity's direction or the pivot is not what was believed
  Filter& f = first_.filter;
  f.P.block<3, 3>(LIFT, LIFT) += c.tuning.tilt * Matrix3::Identity();
  f.P.block<3, 3>(PIVOT, PIVOT) += c.tuning.pivot * Matrix3::Identity();
}

}  // namespace gyrofree::rate
