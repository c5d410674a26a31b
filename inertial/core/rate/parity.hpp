// A small filter that believes in rigid bodies only: what the axes of a board say of one another.
// Equations H-1 to H-7 of docs/equations-layouts.md. numpy twin: tests/support/parity_twin.py.
#pragma once

#include <array>

#include "common/matrix.hpp"

namespace gyrofree::parity {

constexpr int MOST_AXES = 32;

// x = [omega | omega' | p | offset of one axis]                                             (H-1)
enum Segment : int { OMEGA = 0, ALPHA = 3, P = 6, OFFSET = 9, STATES = 10 };
constexpr int MOTION = 6;    // [omega' | p]
constexpr int PRODUCTS = 6;  // of the rate: xx xy xz yy yz zz

// m/s^2, spread of readings of an axis that says nothing: what ignoring it costs in likelihood
constexpr double UNUSED_SIGMA = 10.0;

using Axes = VectorUpTo<MOST_AXES>;
using AxisMatrix = UpTo<MOST_AXES>;
using Mask = Eigen::Array<bool, Eigen::Dynamic, 1, Eigen::ColMajor, MOST_AXES, 1>;
template <int Columns>
using OfAxes = Eigen::Matrix<double, Eigen::Dynamic, Columns, Eigen::ColMajor, MOST_AXES, Columns>;
using Readings = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

// The filter's belief: state and covariance.
struct Belief {
  Vector<STATES> x;
  Matrix<STATES> covariance;
};

// What is known of the N axes; variances of one block's mean, (m/s^2)^2.
struct Constants {
  OfAxes<MOTION> J;
  OfAxes<PRODUCTS> Q;
  Axes bias;       // m/s^2
  Axes reference;  // m/s^2, readings at the last standstill
  Axes white;
  Axes offset;
};

struct Tuning {
  double sigma_alpha;  // rad/s^2 per root s
  double sigma_force;  // m/s^2 per root s
  double scale;        // of 1
  double cross;        // of 1, of the RMS axis
};

struct Observation {
  Axes reading;
  OfAxes<STATES> H;
  AxisMatrix spread;  // of the products, second order
};

// What a correction says beside the belief.
struct Fit {
  double nis;
  double log_determinant;
  Axes residual;  // of every axis against all others, m/s^2; empty where not asked for
  Axes sigma;
};

// What may be wrong with axes i and j; j is -1 where one axis is meant.
enum class Kind : int { None, OffsetOf, Ignore, MirrorZero, MirrorReference, Swap, SwapChanges };
struct Hypothesis {
  Kind kind;
  int i;
  int j;
  int since;  // it holds after this block; -1: always
};

// How well a hypothesis explains blocks.
struct Score {
  double score;  // -2 log likelihood
  double nis;
  int degrees;
};

void predict(Belief& belief, double dt, const Tuning& tuning);
Observation observe(const Belief& belief, const Constants& c, int offset_axis);
Fit correct(Belief& belief, const Axes& f, const Axes& R, const Mask& used, const Constants& c, int offset_axis,
            bool residuals);
Axes variances(const Axes& f, const Axes& reference, const Constants& c, const Tuning& tuning);
Axes altered(const Axes& f, const Axes& bias, const Axes& reference, const Hypothesis& about);
Fit step(Belief& belief, const Axes& block, double dt, const Mask& used, const Mask& learned, const Constants& c,
         const Tuning& tuning);
Score replay(Belief& belief, const Readings& blocks, const Eigen::VectorXd& dt, const Mask& used,
             const Hypothesis& about, const Constants& c, const Tuning& tuning);
Belief start(const Constants& c, const Axes& f, const Mask& used, double unknown, bool sees_products);
Axes offsets_at_rest(const OfAxes<3>& theta, const Axes& mean, const Mask& used);

}  // namespace gyrofree::parity
