// What a filter does with one fix, and the run over many samples and fixes (E-112 to E-127).
#pragma once

#include <span>
#include <vector>

#include "navigation/constraints.hpp"
#include "navigation/fuzzy.hpp"
#include "navigation/leg.hpp"
#include "navigation/trial.hpp"
#include "navigation/update.hpp"
#include "navigation/window.hpp"

namespace gyrofree::navigation {

// What became of a fix; DOUBTED: used with less weight.
enum class Status : int { USED = 0, REJECTED = 1, WITHHELD = 2, LATE = 3, READMITTED = 4, DOUBTED = 5 };
constexpr bool was_used(Status s) {
  return s == Status::USED || s == Status::READMITTED || s == Status::DOUBTED;
}

enum class Horizon : int { NONE = 0, PREDICTIVE = 1, ROBUST = 2 };

// A filter's choices.
struct Settings {
  std::array<double, MOST_ROWS + 1> gates{};  // largest NIS by degrees of freedom
  int readmit = 10;         // refusals in a row after which the filter is taken to be wrong
  double fading = 1.0;      // factor on Phi P Phi^T, 1: none
  double huber = FOREVER;   // Mahalanobis distance from which a fix is weighted down; infinite: never
  double low_weight = 0.2;  // weight of a fix that a robust filter hardly believes
  Horizon window = Horizon::NONE;
  int horizon = 0;          // N; 0: fuzzy
  Arrival arrival = Arrival::MEAN;
  double kappa = 1.0;       // on the mean covariance
  int passes = 0;           // of reweighting in the robust horizon
  bool literal = false;     // fuzzy inputs as read, not conditioned
  FuzzyRules fuzzy;
  double wander = 0.0;      // share of a receiver's sigma that wanders and does not average out (E-138)
  double lag = 0.0;         // s, of a receiver's position where the filter does not estimate it
  double adapt = 0.0;       // share of the newest fix in what is known of the receiver's noise (E-137)
  double jump_accel = 0.0;  // m/s^2, by which a bias may have changed where innovations last (E-141)
  double jump_gyro = 0.0;   // rad/s
  Rules rules;
  bool tries = false;       // wheels are believed only while the data agree
  TrialSettings trial;
  Vector3 lever_b = Vector3::Zero();  // m, IMU to antenna

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("gates", s.gates), v("readmit", s.readmit), v("fading", s.fading), v("huber", s.huber);
    v("low_weight", s.low_weight), v("window", s.window), v("horizon", s.horizon);
    v("arrival", s.arrival), v("kappa", s.kappa), v("passes", s.passes), v("literal", s.literal);
    v("fuzzy", s.fuzzy), v("wander", s.wander), v("lag", s.lag), v("adapt", s.adapt);
    v("jump_accel", s.jump_accel), v("jump_gyro", s.jump_gyro);
    v("rules", s.rules), v("tries", s.tries), v("trial", s.trial);
    v("lever_b", s.lever_b);
  }
};

// All that a filter remembers but its leg.
struct Memory {
  Window window;
  int refused = 0;       // in a row
  int doubted = 0;       // low weights in a row
  double still_f = 0.0;  // |mean f| at standstill, m/s^2
  StateVector estimate;  // the error that the last fix used was answered with
  Trial trial;           // of the wheels

  explicit Memory(int n = CORE, int capacity = 0)
      : window(n, capacity), estimate(StateVector::Zero(n)), trial(n) {}

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("window", s.window), v("refused", s.refused), v("doubted", s.doubted);
    v("still_f", s.still_f), v("estimate", s.estimate), v("trial", s.trial);
  }
};

// What a filter says of a fix. Numbers that there are not are NaN.
struct FixResult {
  Status status = Status::LATE;
  int dof = 0;                 // rows compared
  int horizon = 0;             // fixes looked back
  Wheels wheels = Wheels::NONE;  // what is believed of them after it
  int switched = 0;            // 1: since this fix
  double difference = 0.0;     // of the filters with and without wheels (E-135)
  double nis = 0.0;
  double crisp = 0.0;          // the horizon before rounding
  Vector<2> inputs;            // of the fuzzy rules, m/s^2 and rad/s
  Vector<MOST_ROWS> y;         // computed - measured before the correction, rows as compared
  Vector<MOST_ROWS> sigma;     // of y, as the filter expects
  Weights weight;
  Vector3 error_ned;           // computed - measured position before the correction, m
  double yaw = 0.0;            // rad, at the time of the fix's velocity, before the correction
  Vector<6> left;              // computed - measured position and velocity after it
  Nominal x;
  Eigen::Matrix<double, MOVING, MOVING, Eigen::RowMajor> P;  // of attitude, velocity, position

  FixResult();

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("status", s.status), v("dof", s.dof), v("horizon", s.horizon);
    v("wheels", s.wheels), v("switched", s.switched), v("difference", s.difference), v("nis", s.nis);
    v("crisp", s.crisp), v("inputs", s.inputs), v("y", s.y), v("sigma", s.sigma);
    v("weight", s.weight), v("error_ned", s.error_ned), v("yaw", s.yaw), v("left", s.left);
    v("x", s.x), v("P", s.P);
  }
};

// Samples up to time `until`, with the constraints that come due; returns the first sample not used up.
std::size_t run_to(Leg& leg, const Model& model, const Rules& rules, Samples samples, std::size_t start,
                   std::size_t stop, double until);

// Judges and applies a fix at the leg's time; rate_b is the measured one then. A fix that is withheld
// or refused leaves the leg as close() makes it: call on a copy.
FixResult take(Leg& leg, const Model& model, const Settings& settings, Memory& memory, const Fix& fix,
               const Vector3& rate_b);

// The two inputs of the fuzzy rules (E-128): |f^b| in m/s^2 and |omega^b| in rad/s.
Vector<2> motion(const Leg& leg, bool literal, double still_f);

// Starts the trial of the wheels, where the settings ask for one and none runs.
void begin_trial(Leg& leg, const Settings& settings, Memory& memory);

// `run_to` for a filter and, while wheels are on trial, for the other one beside it.
std::size_t run_both(Leg& leg, const Model& model, const Settings& settings, Memory& memory, Samples samples,
                     std::size_t start, std::size_t stop);

// Goes from `leg` to the time of a fix and takes it there: used, `leg` becomes the corrected one. Where
// the wheels' trial ends another way, `leg` becomes the other filter's. `k` is the first sample after
// the leg's time, and on return that of the fix's.
FixResult take_at(Leg& leg, const Model& model, const Settings& settings, Memory& memory, Samples samples,
                  std::size_t& k, std::size_t stop, const Fix& fix);

// Samples start..stop-1 and all fixes among them, in order.
std::vector<FixResult> run(Leg& leg, const Model& model, const Settings& settings, Memory& memory,
                           Samples samples, std::size_t start, std::size_t stop, std::span<const Fix> fixes);

}  // namespace gyrofree::navigation
