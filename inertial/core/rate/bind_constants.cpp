// Constants of the rate estimators: plain numbers by name, set from Python's settings.
#include <stdexcept>

#include "rate/bind_rate.hpp"
#include "rate/bound.hpp"
#include "rate/least_squares.hpp"

namespace gyrofree::rate {
namespace {

// A property that reads and writes a matrix of fixed size; axes beyond those in use are not shown.
template <typename Number, int Rows, int Columns>
void matrix(nb::class_<Sensor>& c, const char* name, Eigen::Matrix<Number, Rows, Columns> Sensor::*member) {
  c.def_prop_rw(
      name,
      [member](const Sensor& s) {
        const auto& m = s.*member;
        const int rows = Rows == MOST_AXES ? s.n : Rows, columns = Columns == MOST_AXES ? s.n : Columns;
        return to_numpy(Eigen::MatrixXd(m.topLeftCorner(rows, columns)));
      },
      [member, name](Sensor& s, const MatrixIn& value) {
        const auto given = map(value);
        if (given.rows() > Rows || given.cols() > Columns)
          throw std::invalid_argument(std::string(name) + ": too many rows or columns");
        auto& m = s.*member;
        m.setZero();
        m.topLeftCorner(given.rows(), given.cols()) = given;
      },
      nb::rv_policy::automatic);
}

template <int Rows>
void vector(nb::class_<Sensor>& c, const char* name, Vector<Rows> Sensor::*member) {
  c.def_prop_rw(
      name, [member](const Sensor& s) { return to_numpy_vector((s.*member).head(Rows == MOST_AXES ? s.n : Rows)); },
      [member, name](Sensor& s, const VectorIn& value) {
        if (value.shape(0) > Rows) throw std::invalid_argument(std::string(name) + ": too many numbers");
        (s.*member).setZero();
        (s.*member).head(value.shape(0)) = map(value);
      },
      nb::rv_policy::automatic);
}

Sensor blank_sensor() {
  Sensor s;
  s.W.setZero();
  s.M.setZero();
  s.SQ_alpha.setZero();
  s.SQ_force.setZero();
  s.Q.setZero();
  s.theta_b.setZero();
  s.r_b.setZero();
  s.used.setZero();
  s.limit.setZero();
  return s;
}

void bind_sensor(nb::module_& m) {
  nb::class_<Sensor> c(m, "RateSensor", "What a layout measures directly (inertial/rate/observed.py).");
  c.def("__init__", [](Sensor* self) { new (self) Sensor(blank_sensor()); });
  c.def_rw("n", &Sensor::n).def_rw("m", &Sensor::m);
  c.def_rw("feedback", &Sensor::feedback).def_rw("plain", &Sensor::plain);
  matrix(c, "W", &Sensor::W);
  matrix(c, "M", &Sensor::M);
  matrix(c, "SQ_alpha", &Sensor::SQ_alpha);
  matrix(c, "SQ_force", &Sensor::SQ_force);
  matrix(c, "R_alpha", &Sensor::R_alpha);
  matrix(c, "R_p", &Sensor::R_p);
  matrix(c, "R_c", &Sensor::R_c);
  matrix(c, "known", &Sensor::known);
  matrix(c, "drift", &Sensor::drift);
  matrix(c, "Q", &Sensor::Q);
  matrix(c, "theta_b", &Sensor::theta_b);
  matrix(c, "r_b", &Sensor::r_b);
  vector(c, "used", &Sensor::used);
  vector(c, "limit", &Sensor::limit);
  matrix(c, "basis", &Sensor::basis);
  vector(c, "spread", &Sensor::spread);
}

void bind_limits(nb::module_& m) {
  nb::class_<StillLimits> c(m, "RateStillLimits", "still.Config for the core.");
  c.def(nb::init<>());
  c.def_rw("spread_limit", &StillLimits::spread_limit);
  c.def_rw("quiet_limit", &StillLimits::quiet_limit).def_rw("turn_limit", &StillLimits::turn_limit);
  c.def_rw("tilt_limit", &StillLimits::tilt_limit).def_rw("steady_limit", &StillLimits::steady_limit);
  c.def_rw("drift_steady", &StillLimits::drift_steady).def_rw("rate_limit", &StillLimits::rate_limit);
  c.def_rw("rate_slack", &StillLimits::rate_slack).def_rw("sure_rate", &StillLimits::sure_rate);
  c.def_rw("likely_rate", &StillLimits::likely_rate).def_rw("begin_limit", &StillLimits::begin_limit);
  c.def_rw("patience_s", &StillLimits::patience_s).def_rw("drift", &StillLimits::drift);
  c.def_rw("drift_now", &StillLimits::drift_now).def_rw("drift_tilt", &StillLimits::drift_tilt);
  c.def_rw("scale", &StillLimits::scale);
  c.def_rw("window", &StillLimits::window).def_rw("short_window", &StillLimits::short_window);
  c.def_rw("steady_span", &StillLimits::steady_span).def_rw("brief_span", &StillLimits::brief_span);
  c.def_rw("guard", &StillLimits::guard).def_rw("hold", &StillLimits::hold);
  nb::class_<LeastSquaresLimits> l(m, "RateLeastSquaresLimits", "least_squares.Config for the core.");
  l.def(nb::init<>());
  l.def_rw("shortest_standstill", &LeastSquaresLimits::shortest_standstill);
  l.def_rw("longest_step_s", &LeastSquaresLimits::longest_step_s).def_rw("still", &LeastSquaresLimits::still);
}

void bind_tuning(nb::module_& m) {
  nb::class_<Tuning> c(m, "RateTuning", "products_ekf.Config in squares.");
  c.def(nb::init<>()).def_rw("method", &Tuning::method);
  c.def_rw("scale", &Tuning::scale).def_rw("drift", &Tuning::drift).def_rw("centre", &Tuning::centre);
  c.def_rw("pivot_drift", &Tuning::pivot_drift).def_rw("still_rate", &Tuning::still_rate);
  c.def_rw("first_still_rate", &Tuning::first_still_rate).def_rw("products_gate", &Tuning::products_gate);
  c.def_rw("force_gate", &Tuning::force_gate).def_rw("unseen_alpha", &Tuning::unseen_alpha);
  c.def_rw("unseen_rate", &Tuning::unseen_rate);
  c.def_rw("forget", &Tuning::forget).def_rw("bias", &Tuning::bias).def_rw("tilt", &Tuning::tilt);
  c.def_rw("gravity", &Tuning::gravity).def_rw("pivot", &Tuning::pivot);
  c.def_rw("gravity_aid", &Tuning::gravity_aid).def_rw("start_turning", &Tuning::start_turning);
  c.def_rw("axis", &Tuning::axis).def_rw("axis_from", &Tuning::axis_from);
  c.def_rw("axis_limit", &Tuning::axis_limit).def_rw("axis_lost", &Tuning::axis_lost);
  c.def_rw("earth_north", &Tuning::earth_north).def_rw("earth_down", &Tuning::earth_down);
}

void bind_knowledge(nb::module_& m) {
  nb::class_<Knowledge> c(m, "RateKnowledge", "bound.Knowledge in squares.");
  c.def(nb::init<>());
  c.def_rw("biases", &Knowledge::biases).def_rw("tilt", &Knowledge::tilt).def_rw("bias", &Knowledge::bias);
  c.def_rw("centre", &Knowledge::centre).def_rw("pivot", &Knowledge::pivot).def_rw("wander", &Knowledge::wander);
  c.def_rw("axis_from", &Knowledge::axis_from).def_rw("share", &Knowledge::share);
}

}  // namespace

void bind_rate_constants(nb::module_& m) {
  bind_sensor(m);
  bind_limits(m);
  bind_tuning(m);
  bind_knowledge(m);
}

}  // namespace gyrofree::rate
