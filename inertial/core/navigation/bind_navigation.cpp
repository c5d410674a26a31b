// The navigation filters for Python: structs by their fields, runs over numpy arrays.
#include <stdexcept>

#include "common/bind_fields.hpp"
#include "navigation/drag.hpp"
#include "navigation/live.hpp"
#include "navigation/smoother.hpp"

namespace gyrofree {

using namespace navigation;

namespace {

using ImuIn = MatrixIn;

Samples samples_of(const ImuIn& imu) {
  if (imu.shape(1) != sizeof(Sample) / sizeof(double))
    throw std::invalid_argument("samples of " + std::to_string(imu.shape(1)) +
                                " columns, want 7: t, force (3), rate (3)");
  return {reinterpret_cast<const Sample*>(imu.data()), imu.shape(0)};
}

std::vector<Fix> fixes_of(nb::sequence given) {
  std::vector<Fix> out;
  for (const auto fix : given) out.push_back(nb::cast<const Fix&>(fix));
  return out;
}

Vector3 vector3(nb::handle given) {
  Vector3 out;
  detail::set_matrix(out, given, "vector");
  return out;
}

Matrix3 matrix3(nb::handle given) {
  Matrix3 out;
  detail::set_matrix(out, given, "matrix");
  return out;
}

Covariance covariance(nb::handle given) {
  Covariance out;
  detail::set_matrix(out, given, "covariance");
  return out;
}

StateVector state_vector(nb::handle given) {
  StateVector out;
  detail::set_matrix(out, given, "error state");
  return out;
}

void bind_structs(nb::module_& m) {
  bind_fields<Sample>(m, "Sample", "one IMU sample");
  bind_fields<Nominal>(m, "Nominal", "computed position, velocity, attitude, errors of the instruments");
  bind_fields<Model>(m, "Model", "which states a filter has, and the noise that drives them");
  bind_fields<Transition>(m, "Transition", "Phi: upper (9, n), decay (n,)");
  bind_fields<OpenTick>(m, "OpenTick", "integrals over the open tick");
  bind_fields<Tick>(m, "Tick", "a closed tick");
  bind_fields<Interval>(m, "Interval", "integrals over the open interval");
  bind_fields<LocalEarth>(m, "LocalEarth", "the Earth's terms at the start of an interval");
  bind_fields<Shake>(m, "Shake", "noise that the readings show by themselves");
  bind_fields<Receiver>(m, "Receiver", "what the fixes show of their own noise");
  bind_fields<Fix>(m, "Fix", "a fix as the filters take it");
  bind_fields<Measurement>(m, "Measurement", "y, H, R");
  bind_fields<Rules>(m, "Rules", "what a car's wheels say, and when");
  bind_fields<TrialSettings>(m, "TrialSettings", "when the wheels are believed");
  bind_fields<Trial>(m, "Trial", "the filter beside it, and the verdict on the wheels");
  bind_fields<FuzzyRules>(m, "FuzzyRules", "sets and consequents of the fuzzy horizon");
  bind_fields<Settings>(m, "Settings", "a filter's choices");
  bind_fields<Epoch>(m, "Epoch", "a fix of the horizon, and what a pass makes of it");
  bind_fields<Memory>(m, "Memory", "all that a filter remembers but its leg");
  bind_fields<FixResult>(m, "FixResult", "what a filter says of a fix");
}

void bind_leg(nb::module_& m) {
  bind_fields<Leg>(m, "Leg", "everything that changes between two fixes")
      .def("run", [](Leg& leg, const Model& model, const ImuIn& imu, std::size_t start, std::size_t stop,
                     double until, double every) {
             return run_leg(leg, model, samples_of(imu), start, std::min(stop, imu.shape(0)), until, every);
           }, nb::arg("model"), nb::arg("imu"), nb::arg("start") = 0, nb::arg("stop") = std::size_t(-1),
           nb::arg("until") = FOREVER, nb::arg("every") = FOREVER,
           "mechanise samples start..stop-1 of imu (n, 7); returns the first not used up")
      .def("close", [](Leg& leg, const Model& model) { close(leg, model); }, "bring Phi and Q to the leg's time")
      .def("covariance", [](const Leg& leg, const Model& model) { return to_numpy(covariance_now(leg, model)); },
           "(n, n) at the leg's time")
      .def("transition", [](const Leg& leg) {
             Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic> out = leg.Phi.decay.asDiagonal();
             out.topRows<MOVING>() = leg.Phi.upper;
             return to_numpy(out);
           }, "Phi (n, n) since the last measurement")
      .def("reset", [](Leg& leg, nb::handle error, const Model& model) {
             reset(leg.x, state_vector(error), model);
           }, "take an error (n,) out of the nominal state")
      .def("compared", [](const Leg& leg, const Model& model, nb::handle rate_b, nb::handle lever_b,
                          const Fix& fix) { return compared(leg, model, vector3(rate_b), vector3(lever_b), fix); },
           "all seven rows of a fix at the leg's state")
      .def("constraint", [](const Leg& leg, const Model& model, const Rules& rules) {
             return constraint(leg, model, rules);
           }, "what the wheels say now; no rows: nothing")
      .def("standing", [](const Leg& leg, const Rules& rules) { return standing(leg, rules); })
      .def("motion", [](const Leg& leg, bool literal, double still_f) {
             return to_numpy_vector(motion(leg, literal, still_f));
           }, "the two inputs of the fuzzy rules");
  m.def("new_leg", [](int n) { return Leg(n); }, "a leg of n states with everything zero, unit covariance");
}

void bind_update(nb::module_& m) {
  m.def("chosen", &chosen, "the rows that a fix has, with R");
  m.def("innovate", [](nb::handle P, const Measurement& z) {
    const Innovation out = innovate(covariance(P), z);
    return nb::make_tuple(to_numpy(out.PHt), to_numpy(out.S));
  }, "P H^T (n, m) and S (m, m)");
  m.def("absorb", [](nb::handle given, const Measurement& z) {
    Covariance P = covariance(given);
    const Innovation innovation = innovate(P, z);
    const Whitened white = whiten(innovation.S, z.y);
    const StateVector error = absorb(P, innovation, white);
    return nb::make_tuple(to_numpy_vector(error), to_numpy(P), white.nis);
  }, "K y (n,), P (n, n) after, NIS");
  m.def("make_consistent", [](nb::handle given, const Measurement& z) {
    Covariance P = covariance(given);
    const double factor = make_consistent(P, z);
    return nb::make_tuple(factor, to_numpy(P));
  }, "factor on P (n, n) that brings NIS down to the rows, and P times it");
  m.def("huber_weights", [](const Measurement& z, double limit) {
    return to_numpy_vector(huber_weights(z.R, z.y, limit));
  }, "weights (3,) of position, velocity, heading for residuals y of covariance R");
}

void bind_window(nb::module_& m) {
  bind_fields<Window>(m, "Window", "the last fixes of a moving horizon")
      .def("push", [](Window& w, const Transition& Phi, nb::handle Q, const Measurement& z, nb::handle start) {
        w.push(Phi, covariance(Q), z, covariance(start));
      })
      .def("kalman_beside", &Window::kalman_beside)
      .def("arrival", [](const Window& w, int N, int mode, double kappa) {
        return to_numpy(w.arrival(N, static_cast<Arrival>(mode), kappa));
      })
      .def("forward", [](Window& w, int n, nb::handle P) { w.forward(n, covariance(P)); })
      .def("smooth", &Window::smooth)
      .def("robust", [](Window& w, int n, nb::handle P, double huber, int passes) {
        w.robust(n, covariance(P), huber, passes);
      })
      .def("of_last", [](Window& w, int n, int j) -> Epoch& { return w.of_last(n, j); },
           nb::rv_policy::reference_internal, "the j-th of the last n fixes");
  m.def("new_window", [](int n, int capacity) { return Window(n, capacity); });
  m.def("new_memory", [](int n, int capacity) { return Memory(n, capacity); });
  m.def("membership", [](double value, nb::handle points) {
    return to_numpy_vector(membership(value, vector3(points)));
  });
  m.def("crisp_horizon", &crisp_horizon);
  m.def("whole_horizon", &whole_horizon);
  m.attr("CAPACITY") = CAPACITY;
}

void bind_runs(nb::module_& m) {
  m.def("run", [](Leg& leg, const Model& model, const Settings& settings, Memory& memory, const ImuIn& imu,
                  std::size_t start, std::size_t stop, nb::sequence fixes) {
    return table(run(leg, model, settings, memory, samples_of(imu), start, std::min(stop, imu.shape(0)),
                     fixes_of(fixes)));
  }, "samples start..stop-1 of imu (n, 7) and the fixes among them; a row per fix");
  m.attr("RESULT_COLUMNS") = columns_of<FixResult>();
  m.def("smooth", [](const Leg& leg, const Model& model, const Settings& settings, const Memory& memory,
                     const ImuIn& imu, std::size_t start, std::size_t stop, nb::sequence fixes) {
    return table(smooth(leg, model, settings, memory, samples_of(imu), start, std::min(stop, imu.shape(0)),
                        fixes_of(fixes)));
  }, "filter samples start..stop-1 and the fixes among them, then smooth; a row per fix");
  m.attr("SMOOTHED_COLUMNS") = columns_of<Smoothed>();
  bind_fields<Live>(m, "Live", "a filter on samples that come one by one")
      .def("feed", [](Live& live, const ImuIn& imu) { live.feed(samples_of(imu)); })
      .def("begin", &Live::begin)
      .def("stop", &Live::stop)
      .def("too_late", &Live::too_late)
      .def("take", &Live::take)
      .def("newest", &Live::newest)
      .def("reaches", &Live::reaches)
      .def("turned_back", [](const Live& live, nb::handle C_nb, nb::handle bias_gyro, double t) {
        return to_numpy(live.turned_back(matrix3(C_nb), vector3(bias_gyro), t));
      });
  bind_fields<DragFilter>(m, "DragFilter", "how a receiver's position walks off its velocity")
      .def("look", [](DragFilter& f, double dt, nb::handle noise, nb::handle y, nb::handle speed,
                      nb::handle white, double gate) {
        Vector<6> n;
        detail::set_matrix(n, noise, "noise");
        return f.look(dt, n, vector3(y), vector3(speed), vector3(white), gate);
      })
      .def("statistic", &DragFilter::statistic);
}

}  // namespace

void bind_navigation(nb::module_& parent) {
  auto m = parent.def_submodule("navigation", "strapdown, error model, filters");
  m.attr("__name__") = "navigation";
  bind_structs(m);
  bind_leg(m);
  bind_update(m);
  bind_window(m);
  bind_runs(m);
}

}  // namespace gyrofree
