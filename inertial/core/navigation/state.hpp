// What a navigation filter carries from sample to sample: the nominal state, the segments of the
// error state, and a leg, which is all that changes between two fixes. docs/equations-ins.md.
#pragma once

#include <array>

#include "common/matrix.hpp"

namespace gyrofree::navigation {

// Components of vectors in n = north, east, down. Heights count up: HEIGHT takes the place of DOWN.
constexpr int NORTH = 0, EAST = 1, DOWN = 2, HEIGHT = 2;

// Segments of the error state, error = computed - true, positions in metres (E-106):
// C_true = Exp(psi) C_computed; what is left of the biases after the current estimates.
constexpr int PSI = 0;          // psi_n, rad
constexpr int DV = 3;           // of v_n, m/s
constexpr int DP = 6;           // north, east, height, m
constexpr int BIAS_ACCEL = 9;   // m/s^2
constexpr int BIAS_GYRO = 12;   // rad/s
constexpr int CORE = 15;        // every filter has these; further ones at the end, see Model
constexpr int ABSENT = -1;

constexpr int MOVING = 9;       // attitude, velocity, position; all others only decay
constexpr int MOST_STATES = 32;

using StateVector = VectorUpTo<MOST_STATES>;
using Covariance = UpTo<MOST_STATES>;
// Direction cosines row by row, as numpy reads them.
using Attitude = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;

// One IMU sample; a row of seven numbers in numpy. It acts from the time before it to its own.
struct Sample {
  double t = 0.0;                         // s
  Vector3 f_b = Vector3::Zero();          // m/s^2
  Vector3 omega_b = Vector3::Zero();      // rad/s

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("t", s.t), v("f_b", s.f_b), v("omega_b", s.omega_b);
  }
};
static_assert(sizeof(Sample) == 7 * sizeof(double));

// Computed position, velocity, attitude, and the errors of the instruments as far as they are known.
struct Nominal {
  double latitude = 0.0;                      // rad
  double longitude = 0.0;                     // rad
  double height = 0.0;                        // m above the ellipsoid
  Vector3 v_n = Vector3::Zero();              // m/s
  Attitude C_nb = Attitude::Identity();
  Vector3 bias_accel = Vector3::Zero();       // m/s^2
  Vector3 bias_gyro = Vector3::Zero();        // rad/s
  Vector3 scale_accel = Vector3::Zero();      // measured / true - 1
  Vector3 scale_gyro = Vector3::Zero();
  double lag_position = 0.0;                  // s, by which the receiver's position is older than it says
  double lag_velocity = 0.0;                  // s, likewise
  double mount_pitch = 0.0;                   // rad, vehicle against body
  double mount_yaw = 0.0;                     // rad
  double axle = 0.0;                          // m, rear axle behind the IMU

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("latitude", s.latitude), v("longitude", s.longitude), v("height", s.height);
    v("v_n", s.v_n), v("C_nb", s.C_nb);
    v("bias_accel", s.bias_accel), v("bias_gyro", s.bias_gyro);
    v("scale_accel", s.scale_accel), v("scale_gyro", s.scale_gyro);
    v("lag_position", s.lag_position), v("lag_velocity", s.lag_velocity);
    v("mount_pitch", s.mount_pitch), v("mount_yaw", s.mount_yaw), v("axle", s.axle);
  }
};

// Which states a filter has, and the noise that drives them.
struct Model {
  int states = CORE;
  int scale_accel = ABSENT;   // first of three
  int scale_gyro = ABSENT;    // first of three
  int lag_position = ABSENT;
  int lag_velocity = ABSENT;
  int mount_pitch = ABSENT;
  int mount_yaw = ABSENT;
  int axle = ABSENT;
  StateVector density = StateVector::Zero(CORE);   // diagonal of G (E-109), unit^2/s
  StateVector decay = StateVector::Zero(CORE);     // 1/s, of what only decays
  double shake = 1.0;  // share of the readings' shaking that is noise to navigation (E-131)
  double turn = 0.0;   // s, turns' share that gyros tell wrongly, squared, by the length of a turn (E-139)
  double axes = 0.0;   // rad, of the sensors' axes against one another: no tilt is told better (E-142)

  bool has_scale() const { return scale_accel != ABSENT; }
  bool has_lag() const { return lag_position != ABSENT; }
  bool has_car() const { return axle != ABSENT; }

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("states", s.states), v("scale_accel", s.scale_accel), v("scale_gyro", s.scale_gyro);
    v("lag_position", s.lag_position), v("lag_velocity", s.lag_velocity);
    v("mount_pitch", s.mount_pitch), v("mount_yaw", s.mount_yaw), v("axle", s.axle);
    v("density", s.density), v("decay", s.decay), v("shake", s.shake), v("turn", s.turn), v("axes", s.axes);
  }
};

// Phi of the error state: what moves depends on all, what only decays on itself.
//   Phi = [ upper ; 0 diag(decay) ]
struct Transition {
  Eigen::Matrix<double, MOVING, Eigen::Dynamic, Eigen::ColMajor, MOVING, MOST_STATES> upper;
  StateVector decay;   // (n); its first MOVING numbers are not used

  explicit Transition(int n = CORE) : decay(StateVector::Ones(n)) { upper.setIdentity(MOVING, n); }
  void set_identity() {
    upper.setIdentity();
    decay.setOnes();
  }
  int states() const { return static_cast<int>(decay.size()); }

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("upper", s.upper), v("decay", s.decay);
  }
};

// Integrals over the open tick, 0.1 s or less.
struct OpenTick {
  double length = 0.0;                        // s
  Vector3 f_n = Vector3::Zero();              // of the specific force in n, m/s
  Matrix3 C_nb = Matrix3::Zero();             // of C_nb, s
  Vector3 f_b = Vector3::Zero();              // of the readings
  Vector3 omega_b = Vector3::Zero();

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("length", s.length), v("f_n", s.f_n), v("C_nb", s.C_nb), v("f_b", s.f_b), v("omega_b", s.omega_b);
  }
};

// A closed tick, remembered for a second and a half.
struct Tick {
  double t = 0.0;                             // s, its end; 0: none yet
  double length = 0.0;                        // s
  Vector3 v_n = Vector3::Zero();              // at its end
  Vector3 f_b = Vector3::Zero();              // integrals of the readings
  Vector3 omega_b = Vector3::Zero();

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("t", s.t), v("length", s.length), v("v_n", s.v_n), v("f_b", s.f_b), v("omega_b", s.omega_b);
  }
};

// Integrals over the ticks of the open interval (E-108).
struct Interval {
  double length = 0.0;                        // s
  Vector3 s1 = Vector3::Zero();               // int f_n
  Vector3 s2 = Vector3::Zero();               // int s1
  Matrix3 U1 = Matrix3::Zero();               // int C
  Matrix3 U2 = Matrix3::Zero();               // int U1
  Matrix3 M1 = Matrix3::Zero();               // int [f_n x] U1
  Matrix3 M2 = Matrix3::Zero();               // int M1
  Vector3 f_b = Vector3::Zero();              // of the readings
  Vector3 omega_b = Vector3::Zero();

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("length", s.length), v("s1", s.s1), v("s2", s.s2), v("U1", s.U1), v("U2", s.U2);
    v("M1", s.M1), v("M2", s.M2), v("f_b", s.f_b), v("omega_b", s.omega_b);
  }
};

// The Earth's terms at the start of an interval, and how they change with L and h (E-117).
struct LocalEarth {
  double latitude = 0.0, height = 0.0;
  double sine = 0.0, cosine = 1.0, tangent = 0.0;      // of the latitude
  double inverse_n = 0.0, inverse_e = 0.0;             // 1 / (R_N + h), 1 / (R_E + h)
  double gravity = 0.0, gravity_by_height = 0.0, gravity_by_latitude = 0.0;
  double n_by_latitude = 0.0, e_by_latitude = 0.0;     // of the radii

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("latitude", s.latitude), v("height", s.height);
    v("sine", s.sine), v("cosine", s.cosine), v("tangent", s.tangent);
    v("inverse_n", s.inverse_n), v("inverse_e", s.inverse_e);
    v("gravity", s.gravity), v("gravity_by_height", s.gravity_by_height);
    v("gravity_by_latitude", s.gravity_by_latitude);
    v("n_by_latitude", s.n_by_latitude), v("e_by_latitude", s.e_by_latitude);
  }
};

// Noise that the readings show by themselves (E-131).
struct Shake {
  bool seen = false;
  Vector3 last_f = Vector3::Zero();           // the last whole sample
  Vector3 last_omega = Vector3::Zero();
  Vector3 accel = Vector3::Zero();            // density squared
  Vector3 gyro = Vector3::Zero();

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("seen", s.seen), v("last_f", s.last_f), v("last_omega", s.last_omega);
    v("accel", s.accel), v("gyro", s.gyro);
  }
};

// What the fixes show of their own noise, and what no filter of white noise can know (E-137, E-138).
// Differences between a fix and the filter that stay are not the receiver's: they say that the filter
// is wrong (E-141).
struct Receiver {
  double position = 1.0;              // its position's variance over what it says, 1 or more
  double velocity = 1.0;              // likewise
  Vector3 wander = Vector3::Zero();   // m^2, of the part of its position's error that wanders slowly
  Vector3 last_position = Vector3::Zero();  // m, innovation of the last fix
  Vector3 last_velocity = Vector3::Zero();  // m/s
  Vector3 lasting = Vector3::Zero();  // innovations of velocity over their sigma, a mean
  double disagreement = 1.0;          // mean square of that over what white ones give

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("position", s.position), v("velocity", s.velocity), v("wander", s.wander);
    v("last_position", s.last_position), v("last_velocity", s.last_velocity);
    v("lasting", s.lasting), v("disagreement", s.disagreement);
  }
};

constexpr int TICKS = 16;  // remembered: 1.6 s
constexpr int TICKS_A_SECOND = 10;
constexpr double SAME_TIME_S = 1e-9;  // nearer than this two times are one

// Everything that changes between two fixes. A plain value: `trial = leg` sets one aside.
struct Leg {
  Nominal x;
  double time = 0.0;            // s, of x
  double since_constraint = 0.0;  // s
  bool wheels = true;           // whether the wheels' constraint, where the model has it, is applied
  double strain = 0.0;          // NIS per row of the wheels' constraint, mean over the last looks (E-136)
  bool quiet = false;           // since the last fix the readings looked like a standstill
  double moved = 0.0;           // squared velocity of fixes then over its variance, a mean (E-140)
  Covariance P;                 // just after the last measurement
  Transition Phi;               // since then, closed intervals
  Covariance Q;
  OpenTick tick;
  Interval interval;
  LocalEarth earth;
  Shake shake;
  Receiver receiver;
  std::array<Tick, TICKS> ticks{};  // newest last

  explicit Leg(int n = CORE)
      : P(Covariance::Identity(n, n)), Phi(n), Q(Covariance::Zero(n, n)) {}
  int states() const { return static_cast<int>(P.rows()); }

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("x", s.x), v("time", s.time), v("since_constraint", s.since_constraint);
    v("wheels", s.wheels), v("strain", s.strain), v("quiet", s.quiet), v("moved", s.moved);
    v("P", s.P), v("Phi", s.Phi), v("Q", s.Q), v("tick", s.tick), v("interval", s.interval);
    v("earth", s.earth), v("shake", s.shake), v("receiver", s.receiver), v("ticks", s.ticks);
  }
};

// The covariance that is told: with what no number of fixes takes away (E-138, E-142).
inline void tell_what_stays(Eigen::Matrix<double, MOVING, MOVING, Eigen::RowMajor>& P, const Model& model,
                            const Vector3& wander) {
  for (int i = 0; i < DOWN; ++i) P(PSI + i, PSI + i) += model.axes * model.axes;
  for (int i = 0; i < 3; ++i) P(DP + i, DP + i) += wander(i);
}

}  // namespace gyrofree::navigation
