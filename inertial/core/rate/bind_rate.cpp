// Rate estimators for Python: constants by name, whole batches at a time.
#include <nanobind/stl/vector.h>

#include <cstring>
#include <memory>
#include <stdexcept>

#include "common/python.hpp"
#include "rate/bind_rate.hpp"
#include "rate/bound.hpp"
#include "rate/least_squares.hpp"

namespace gyrofree {
namespace rate {
namespace {

using RowsOut = nb::ndarray<std::uint8_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

Row* rows_of(const RowsOut& rows, std::size_t n) {
  if (rows.shape(0) != n || rows.shape(1) != sizeof(Row))
    throw std::invalid_argument("rows: want one of the estimators' row type for every sample");
  return reinterpret_cast<Row*>(rows.data());
}

void check(const VectorIn& t_s, const MatrixIn& f_axis, const Sensor& s) {
  if (f_axis.shape(0) != t_s.shape(0) || f_axis.shape(1) != static_cast<std::size_t>(s.n))
    throw std::invalid_argument("readings: want one row for every time, one column for every axis");
}

// The numbers of an estimator's memory as bytes, for the same build only. Eigen's fixed matrices hold
// their numbers in place and nothing else: their bytes are their value.
template <typename Memory>
nb::bytes image(const Memory& memory) {
  return nb::bytes(reinterpret_cast<const char*>(&memory), sizeof(Memory));
}

template <typename Memory>
void restore(Memory& memory, const nb::bytes& image) {
  if (image.size() != sizeof(Memory)) throw std::invalid_argument("this state is of another version of the core");
  std::memcpy(static_cast<void*>(&memory), image.c_str(), sizeof(Memory));
}

class ProductsFilter {
 public:
  struct Memory {
    Frame frame;
    Bound bound;
  };

  ProductsFilter(const Sensor& sensor, const Tuning& tuning, const StillLimits& limits)
      : c_{sensor, tuning, limits} {}

  void follow(const Sensor& whole, const Knowledge& what) {
    whole_ = whole;
    what_ = what;
    follows_ = true;
  }

  void run(const VectorIn& t_s, const MatrixIn& f_axis, const RowsOut& out) {
    check(t_s, f_axis, c_.sensor);
    Row* row = rows_of(out, t_s.shape(0));
    for (std::size_t k = 0; k < t_s.shape(0); ++k, ++row) {
      memory_->frame.advance(c_, t_s.data()[k], f_axis.data() + k * c_.sensor.n);
      write(memory_->frame, c_, *row);
      if (follows_ && memory_->frame.started()) follow(*row);
      put(row->bound_sigma, memory_->bound.sigma());
    }
  }

  void exclude(const Sensor& sensor, const MatrixIn& T, const MatrixIn& unknown) {
    const bool fewer = (c_.sensor.used - sensor.used).maxCoeff() > 0.0;
    c_.sensor = sensor;
    memory_->frame.exchange_axes(c_, {fewer, Matrix<MEASURED>(map(T)), Matrix<MEASURED>(map(unknown))});
  }

  bool correct(double t_s, double rate, double sigma, bool is_signed, const VectorIn& axis_b) {
    return memory_->frame.correct(c_, {t_s, rate, sigma, is_signed, Vector3(map(axis_b))});
  }

  void gap() { memory_->frame.gap(); }
  void withhold(bool on) { memory_->frame.intake().withhold(on); }
  void doubt(bool on) { memory_->frame.intake().doubt(on); }
  long refused() { return memory_->frame.intake().refused(); }
  nb::bytes snapshot() const { return image(*memory_); }
  void restore_from(const nb::bytes& bytes) { restore(*memory_, bytes); }
  const Frame& frame() const { return memory_->frame; }
  Noise& noise() { return memory_->frame.noise(); }
  const Noise& noise() const { return memory_->frame.noise(); }

 private:
  void follow(const Row& row) {
    const Frame& frame = memory_->frame;
    const Motion motion{frame.filter().omega(), Vector3(row.alpha_b[0], row.alpha_b[1], row.alpha_b[2]),
                        frame.filter().q_nb, frame.still(), frame.dt()};
    memory_->bound.step(whole_, what_, motion);
  }

  Constants c_;
  std::unique_ptr<Memory> memory_ = std::make_unique<Memory>();
  Sensor whole_;
  Knowledge what_;
  bool follows_ = false;
};

class LeastSquaresFilter {
 public:
  LeastSquaresFilter(const Sensor& sensor, const LeastSquaresLimits& limits) : sensor_(sensor), limits_(limits) {}

  void run(const VectorIn& t_s, const MatrixIn& f_axis, const RowsOut& out) {
    check(t_s, f_axis, sensor_);
    Row* row = rows_of(out, t_s.shape(0));
    for (std::size_t k = 0; k < t_s.shape(0); ++k, ++row) {
      memory_->advance(sensor_, limits_, t_s.data()[k], f_axis.data() + k * sensor_.n);
      memory_->write(sensor_, *row);
    }
  }

  void exclude(const Sensor& sensor) {
    sensor_ = sensor;
    memory_->exchange_axes();
  }

  void gap() { memory_->gap(); }
  void withhold(bool on) { memory_->intake().withhold(on); }
  void doubt(bool on) { memory_->intake().doubt(on); }
  long refused() { return memory_->intake().refused(); }
  nb::bytes snapshot() const { return image(*memory_); }
  void restore_from(const nb::bytes& bytes) { restore(*memory_, bytes); }

 private:
  Sensor sensor_;
  LeastSquaresLimits limits_;
  std::unique_ptr<LeastSquares> memory_ = std::make_unique<LeastSquares>();
};

class BoundAlong {
 public:
  BoundAlong(const Sensor& sensor, const Knowledge& what) : sensor_(sensor), what_(what) {}

  void step(const VectorIn& omega_b, const VectorIn& alpha_b, const VectorIn& q_nb, bool still, double dt) {
    const auto q = map(q_nb);
    bound_.step(sensor_, what_, {Vector3(map(omega_b)), Vector3(map(alpha_b)), {q(0), q(1), q(2), q(3)}, still, dt});
  }

  bool known() const { return bound_.known(); }
  VectorOut sigma() const { return to_numpy_vector(bound_.sigma()); }

 private:
  Sensor sensor_;
  Knowledge what_;
  Bound bound_;
};

nb::list row_fields() {
  nb::list fields;
  for (const Field& f : ROW_FIELDS) {
    nb::list shape;
    if (f.rows > 0) shape.append(f.rows);
    if (f.columns > 0) shape.append(f.columns);
    fields.append(nb::make_tuple(f.name, f.type, nb::tuple(shape), f.offset));
  }
  return fields;
}

template <typename Filter>
void bind_running(nb::class_<Filter>& c) {
  c.def("run", &Filter::run, nb::arg("t_s"), nb::arg("f_axis"), nb::arg("rows"),
        "Take samples (n, N), m/s^2, at t_s (n,), s; rows (n, bytes of a row) become what is known after each.");
  c.def("gap", &Filter::gap, "Samples are missing before the next one.");
  c.def("withhold", &Filter::withhold, nb::arg("on"), "Take samples for none, as when their axes are stale.");
  c.def("doubt", &Filter::doubt, nb::arg("on"), "Take samples, but say that nothing is valid.");
  c.def_prop_ro("refused_samples", &Filter::refused, "Samples passed over: at the end of a range, frozen, withheld.");
  c.def("snapshot", &Filter::snapshot, "The memory as bytes, for the same build of the core.");
  c.def("restore", &Filter::restore_from, nb::arg("image"), "Back to a snapshot; ValueError for another version's.");
}

void bind_products(nb::module_& m) {
  nb::class_<ProductsFilter> c(m, "RateProductsFilter", "Memory and constants of one products filter.");
  c.def(nb::init<const Sensor&, const Tuning&, const StillLimits&>());
  bind_running(c);
  c.def("follow", nb::overload_cast<const Sensor&, const Knowledge&>(&ProductsFilter::follow), nb::arg("sensor"),
        nb::arg("knowledge"), "Say the bound along the estimate, of all axes.");
  c.def_prop_ro("noise", [](const ProductsFilter& f) { return nb::make_tuple(f.noise().quiet(), f.noise().force()); },
                "Measured variances over the configured ones: of omega' and c, of p.");
  c.def_prop_ro("inexact", [](const ProductsFilter& f) {
    const Inexact& inexact = f.frame().inexact();
    return nb::make_tuple(inexact.seen(), to_numpy(inexact.unit_of_rate()), to_numpy(Eigen::MatrixXd(inexact.rate())));
  }, "Variance of the axes' errors, of 1, as it is seen; the rate's covariance by errors of variance 1; its "
     "derivative by the errors, three to an axis.");
  c.def_prop_ro("surprise", [](const ProductsFilter& f) { return f.frame().surprise().worst(); },
                "The largest chi-square of innovations summed over 8 to 64 samples (E-91).");
  c.def("exclude", &ProductsFilter::exclude, nb::arg("sensor"), nb::arg("T"), nb::arg("unknown"));
  c.def("correct", &ProductsFilter::correct, nb::arg("t_s"), nb::arg("rate"), nb::arg("sigma"), nb::arg("signed"),
        nb::arg("axis_b"), "A tachometer's report (E-50); False where it is not used.");
  c.def_prop_ro("x", [](const ProductsFilter& f) { return to_numpy_vector(f.frame().filter().x); }, nb::rv_policy::automatic);
  c.def_prop_ro("P", [](const ProductsFilter& f) { return to_numpy(f.frame().filter().P); }, nb::rv_policy::automatic);
  c.def_prop_ro("q_nb", [](const ProductsFilter& f) {
    auto out = new_array<VectorOut>({4});
    put(out.data(), f.frame().filter().q_nb);
    return out;
  }, nb::rv_policy::automatic);
  c.def_prop_ro("last_s", [](const ProductsFilter& f) { return f.frame().last_s(); });
  c.def_prop_ro("steps", [](const ProductsFilter& f) { return f.frame().steps(); });
  c.def_prop_ro("refused_products", [](const ProductsFilter& f) { return f.frame().refused_products(); });
  c.def_prop_ro("refused_force", [](const ProductsFilter& f) { return f.frame().refused_force(); });
  c.def_prop_ro("lost", [](const ProductsFilter& f) { return f.frame().lost(); });
}

}  // namespace
}  // namespace rate

void bind_rate(nb::module_& m) {
  using namespace rate;
  bind_rate_constants(m);
  bind_rate_kernels(m);
  m.def("rate_row_fields", &row_fields, "Name, numpy type, shape and offset of each field of a row.");
  m.attr("RATE_ROW_BYTES") = sizeof(Row);
  m.attr("RATE_MOST_AXES") = MOST_AXES;
  bind_products(m);
  nb::class_<LeastSquaresFilter> least(m, "RateLeastSquares", "Memory and constants of the integrating estimator.");
  least.def(nb::init<const Sensor&, const LeastSquaresLimits&>());
  bind_running(least);
  least.def("exclude", &LeastSquaresFilter::exclude, nb::arg("sensor"));
  nb::class_<BoundAlong>(m, "RateBound", "The bound along an estimate (E-48).")
      .def(nb::init<const Sensor&, const Knowledge&>())
      .def("step", &BoundAlong::step, nb::arg("omega_b"), nb::arg("alpha_b"), nb::arg("q_nb"), nb::arg("still"),
           nb::arg("dt"))
      .def_prop_ro("known", &BoundAlong::known)
      .def_prop_ro("sigma", &BoundAlong::sigma, nb::rv_policy::automatic);
}

}  // namespace gyrofree
