// The axis monitor's filter and counters for Python: arrays in, arrays out.
#include <nanobind/stl/tuple.h>

#include <stdexcept>
#include <string>
#include <tuple>

#include "common/python.hpp"
#include "rate/axis_samples.hpp"
#include "rate/parity.hpp"

namespace gyrofree {
namespace {

using namespace parity;
namespace samples = axis_samples;

using MaskIn = nb::ndarray<const bool, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using NumbersInOut = nb::ndarray<double, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using CountsInOut = nb::ndarray<std::int64_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;
using MarksInOut = nb::ndarray<std::int64_t, nb::ndim<1>, nb::c_contig, nb::device::cpu>;
using FlagsOut = nb::ndarray<bool, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// J (N, 6), Q (N, 6), bias, reference, white variance, offset variance (N)
using ConstantsIn = std::tuple<MatrixIn, MatrixIn, VectorIn, VectorIn, VectorIn, VectorIn>;
// sigma_alpha, rad/s^2 per root s; sigma_force, m/s^2 per root s; scale and cross, of 1
using TuningIn = std::tuple<double, double, double, double>;
// kind, i, j, since
using HypothesisIn = std::tuple<int, int, int, int>;

void want(bool fits, const char* what, const char* shape) {
  if (!fits) throw std::invalid_argument(std::string(what) + ": want the shape " + shape);
}

template <typename In>
bool has_shape(const In& a, std::size_t rows, std::size_t columns) {
  return a.shape(0) == rows && a.shape(1) == columns;
}

Axes of_axes(const VectorIn& a, std::size_t n, const char* what) {
  want(a.size() == n, what, "(N,)");
  return map(a);
}

Mask mask_of(const MaskIn& a, std::size_t n, const char* what) {
  want(a.size() == n, what, "(N,)");
  return Eigen::Map<const Eigen::Array<bool, Eigen::Dynamic, 1>>(a.data(), static_cast<Eigen::Index>(n));
}

Constants constants_of(const ConstantsIn& in) {
  const auto& [J, Q, bias, reference, white, offset] = in;
  const std::size_t n = J.shape(0);
  want(n >= 1 && n <= MOST_AXES && has_shape(J, n, MOTION), "J", "(N, 6), N from 1 to 32");
  want(has_shape(Q, n, PRODUCTS), "Q", "(N, 6)");
  return {map(J),
          map(Q),
          of_axes(bias, n, "bias"),
          of_axes(reference, n, "reference"),
          of_axes(white, n, "white"),
          of_axes(offset, n, "offset")};
}

Tuning tuning_of(const TuningIn& in) { return {std::get<0>(in), std::get<1>(in), std::get<2>(in), std::get<3>(in)}; }

Belief belief_of(const VectorIn& x, const MatrixIn& covariance) {
  want(x.size() == STATES, "x", "(10,)");
  want(has_shape(covariance, STATES, STATES), "P", "(10, 10)");
  return {map(x), map(covariance)};
}

Hypothesis hypothesis_of(const HypothesisIn& in, std::size_t axes) {
  const auto& [kind, i, j, since] = in;
  const int n = static_cast<int>(axes);
  if (kind < static_cast<int>(Kind::None) || kind > static_cast<int>(Kind::SwapChanges) || i < 0 || i >= n || j >= n)
    throw std::invalid_argument("hypothesis: want a kind that exists and axes of the layout");
  return {static_cast<Kind>(kind), i, j < 0 ? -1 : j, since};
}

using BeliefOut = std::tuple<VectorOut, MatrixOut>;
BeliefOut told(const Belief& belief) { return {to_numpy_vector(belief.x), to_numpy(belief.covariance)}; }

BeliefOut predicted(const VectorIn& x, const MatrixIn& covariance, double dt, double sigma_alpha, double sigma_force) {
  Belief belief = belief_of(x, covariance);
  predict(belief, dt, {sigma_alpha, sigma_force, 0.0, 0.0});
  return told(belief);
}

using ObservationOut = std::tuple<VectorOut, MatrixOut, MatrixOut>;
ObservationOut observed(const VectorIn& x, const MatrixIn& covariance, const ConstantsIn& constants, int offset_axis) {
  const Constants c = constants_of(constants);
  hypothesis_of({0, std::max(offset_axis, 0), -1, -1}, std::get<0>(constants).shape(0));
  const Observation o = observe(belief_of(x, covariance), c, offset_axis);
  return {to_numpy_vector(o.reading), to_numpy(o.H), to_numpy(o.spread)};
}

using FitOut = std::tuple<VectorOut, MatrixOut, double, double, VectorOut, VectorOut>;
FitOut told(const Belief& belief, const Fit& fit) {
  return {to_numpy_vector(belief.x), to_numpy(belief.covariance), fit.nis, fit.log_determinant,
          to_numpy_vector(fit.residual), to_numpy_vector(fit.sigma)};
}

FitOut stepped(const VectorIn& x, const MatrixIn& covariance, const VectorIn& block, double dt, const MaskIn& used,
               const MaskIn& learned, const ConstantsIn& constants, const TuningIn& tuning) {
  const Constants c = constants_of(constants);
  const std::size_t n = std::get<0>(constants).shape(0);
  Belief belief = belief_of(x, covariance);
  const Fit fit = step(belief, of_axes(block, n, "block"), dt, mask_of(used, n, "used"),
                       mask_of(learned, n, "learned"), c, tuning_of(tuning));
  return told(belief, fit);
}

using ScoreOut = std::tuple<double, double, int, VectorOut, MatrixOut>;
ScoreOut replayed(const VectorIn& x, const MatrixIn& covariance, const MatrixIn& blocks, const VectorIn& dt,
                  const MaskIn& used, const HypothesisIn& about, const ConstantsIn& constants, const TuningIn& tuning) {
  const Constants c = constants_of(constants);
  const std::size_t n = std::get<0>(constants).shape(0);
  want(has_shape(blocks, dt.size(), n), "blocks", "(n, N), n as in dt");
  Belief belief = belief_of(x, covariance);
  const Score score = replay(belief, map(blocks), map(dt), mask_of(used, n, "used"), hypothesis_of(about, n), c,
                             tuning_of(tuning));
  return {score.score, score.nis, score.degrees, to_numpy_vector(belief.x), to_numpy(belief.covariance)};
}

BeliefOut started(const ConstantsIn& constants, const VectorIn& f, const MaskIn& used, double unknown,
                  bool sees_products) {
  const Constants c = constants_of(constants);
  const std::size_t n = std::get<0>(constants).shape(0);
  return told(start(c, of_axes(f, n, "f"), mask_of(used, n, "used"), unknown, sees_products));
}

VectorOut altered_by(const VectorIn& f, const VectorIn& bias, const VectorIn& reference, int kind, int i, int j) {
  const std::size_t n = f.size();
  want(n <= MOST_AXES, "f", "(N,), N up to 32");
  return to_numpy_vector(altered(of_axes(f, n, "f"), of_axes(bias, n, "bias"), of_axes(reference, n, "reference"),
                                 hypothesis_of({kind, i, j, -1}, n)));
}

VectorOut offsets_of(const MatrixIn& theta, const VectorIn& mean, const MaskIn& used) {
  const std::size_t n = theta.shape(0);
  want(n <= MOST_AXES && has_shape(theta, n, 3), "theta_b", "(N, 3), N up to 32");
  return to_numpy_vector(offsets_at_rest(map(theta), of_axes(mean, n, "mean"), mask_of(used, n, "used")));
}

samples::Counts counts_of(const CountsInOut& a, std::size_t n) {
  want(has_shape(a, samples::COUNTERS, n), "count", "(5, N)");
  return {a.data(), samples::COUNTERS, static_cast<Eigen::Index>(n)};
}

std::int64_t gathered(const MatrixIn& f, std::int64_t begin, int per_block, const NumbersInOut& near,
                      const MarksInOut& marks, const VectorIn& noise, const VectorIn& limit, const MatrixIn& parity,
                      const CountsInOut& count) {
  const std::size_t n = f.shape(1);
  want(n >= 1 && n <= MOST_AXES && begin >= 0, "f", "(n, N), N from 1 to 32");
  want(has_shape(near, samples::KEPT, n), "near", "(7, N)");
  want(marks.size() == samples::MARKS, "marks", "(3,)");
  want(noise.size() == n && limit.size() == n, "noise and limit", "(N,)");
  want(has_shape(parity, n, n), "parity", "(N, N)");
  const auto axes = static_cast<Eigen::Index>(n);
  const samples::Known of{{noise.data(), axes}, {limit.data(), axes}, {parity.data(), axes, axes}};
  return samples::gather({f.data(), static_cast<Eigen::Index>(f.shape(0)), axes}, begin, per_block,
                         {near.data(), samples::KEPT, axes}, samples::Marks(marks.data()), of,
                         counts_of(count, n));
}

double measured(const NumbersInOut& near, const MarksInOut& marks, const MatrixIn& parity) {
  const std::size_t n = near.shape(1);
  want(has_shape(near, samples::KEPT, n) && n <= MOST_AXES, "near", "(7, N)");
  want(marks.size() == samples::MARKS && has_shape(parity, n, n), "marks and parity", "(3,) and (N, N)");
  const auto axes = static_cast<Eigen::Index>(n);
  return samples::measured_noise({near.data(), samples::KEPT, axes}, samples::Marks(marks.data()),
                                 {parity.data(), axes, axes});
}

double rounded_to(const NumbersInOut& near, const VectorIn& noise) {
  const std::size_t n = near.shape(1);
  want(has_shape(near, samples::KEPT, n) && n <= MOST_AXES, "near", "(7, N)");
  want(noise.size() == n, "noise", "(N,)");
  const auto axes = static_cast<Eigen::Index>(n);
  return samples::resolution({near.data(), samples::KEPT, axes}, {noise.data(), axes});
}

bool flagged(const CountsInOut& count, int stuck, int at_limit, int spikes, bool coarse, const FlagsOut& out) {
  const std::size_t n = count.shape(1);
  want(has_shape(out, samples::FLAGS, n), "out", "(3, N)");
  return samples::flags(counts_of(count, n), stuck, at_limit, spikes, coarse,
                        {out.data(), samples::FLAGS, static_cast<Eigen::Index>(n)});
}

}  // namespace

void bind_health(nb::module_& module) {
  nb::module_ m = module.def_submodule("health", "What the axes of a board say of one another (H-1 to H-8).");
  m.def("predict", &predicted, nb::arg("x"), nb::arg("P"), nb::arg("dt"), nb::arg("sigma_alpha"),
        nb::arg("sigma_force"), "State (10,) and covariance (10, 10) after dt, s (H-2)");
  m.def("observe", &observed, nb::arg("x"), nb::arg("P"), nb::arg("constants"), nb::arg("offset_axis"),
        "Readings (N,), Jacobian (N, 10), spread (N, N) of the products (H-3)");
  m.def("step", &stepped, nb::arg("x"), nb::arg("P"), nb::arg("block"), nb::arg("dt"), nb::arg("used"),
        nb::arg("learned"), nb::arg("constants"), nb::arg("tuning"),
        "x, P, NIS, log determinant, residual (N,), sigma (N,) after one block (H-2 to H-5)");
  m.def("replay", &replayed, nb::arg("x"), nb::arg("P"), nb::arg("blocks"), nb::arg("dt"), nb::arg("used"),
        nb::arg("about"), nb::arg("constants"), nb::arg("tuning"),
        "Score, NIS, degrees, x, P of blocks under the hypothesis (kind, i, j, since) (H-8)");
  m.def("start", &started, nb::arg("constants"), nb::arg("f"), nb::arg("used"), nb::arg("unknown"),
        nb::arg("sees_products"), "First x and P from one block (H-7)");
  m.def("altered", &altered_by, nb::arg("f"), nb::arg("bias"), nb::arg("reference"), nb::arg("kind"), nb::arg("i"),
        nb::arg("j"), "Readings as they were if the hypothesis holds (H-6)");
  m.def("offsets_at_rest", &offsets_of, nb::arg("theta_b"), nb::arg("mean"), nb::arg("used"),
        "Mean readings (N,) without the specific force that the used axes see");
  m.def("gather", &gathered, nb::arg("f"), nb::arg("begin"), nb::arg("per_block"), nb::arg("near").noconvert(),
        nb::arg("marks").noconvert(), nb::arg("noise"), nb::arg("limit"), nb::arg("parity"),
        nb::arg("count").noconvert(),
        "Takes samples until a block is full; the next one's row");
  m.def("measured_noise", &measured, nb::arg("near").noconvert(), nb::arg("marks").noconvert(), nb::arg("parity"),
        "Variance of the axes' noise over the configured one (H-11)");
  m.def("resolution", &rounded_to, nb::arg("near").noconvert(), nb::arg("noise"),
        "What readings are rounded to, m/s^2, where that hides their noise; else 0 (H-14)");
  m.def("flags", &flagged, nb::arg("count").noconvert(), nb::arg("stuck"), nb::arg("at_limit"), nb::arg("spikes"),
        nb::arg("coarse"), nb::arg("out").noconvert(), "Which axes are stuck, at the end of their range, spiking; true for any");
}

}  // namespace gyrofree
