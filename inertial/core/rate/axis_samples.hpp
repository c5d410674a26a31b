// What one axis says of itself, sample by sample: stuck, at the end of its range, spiking.
// numpy twin: tests/support/parity_twin.py.
#pragma once

#include <cstdint>

#include "common/matrix.hpp"
#include "rate/parity.hpp"

namespace gyrofree::axis_samples {

using parity::MOST_AXES;

// Counters of every axis.
enum Counter : int { SAME, AT_LIMIT, LIMIT_AGE, SPIKES, SPIKE_AGE, COUNTERS };
// What is kept of every axis between samples, spikes removed: the last but two, the last but one, the
// last as it was read, the sum of the block, how far a sample usually is from the middle of its
// neighbours, the running mean of what no motion explains of third differences, over the noise's, and
// the smallest change from one reading to the next, 0 while there was none.
enum Kept : int { EARLIER, BEFORE, LAST, SUM, USUAL, PARITY, CHANGE, KEPT };
// Marks: how many of EARLIER, BEFORE and LAST are known, samples in the block, and in PARITY.
enum Mark : int { KNOWN, FILLED, HEARD, MARKS };
enum Flag : int { STUCK, LIMIT, SPIKING, FLAGS };

using Readings = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
using Near = Eigen::Map<Eigen::Matrix<double, KEPT, Eigen::Dynamic, Eigen::RowMajor>>;
using Counts = Eigen::Map<Eigen::Matrix<std::int64_t, COUNTERS, Eigen::Dynamic, Eigen::RowMajor>>;
using Marks = Eigen::Map<Eigen::Matrix<std::int64_t, MARKS, 1>>;
using Flags = Eigen::Map<Eigen::Array<bool, FLAGS, Eigen::Dynamic, Eigen::RowMajor>>;
using Axes = Eigen::Map<const Eigen::VectorXd>;
// (N, N) projection on what no angular acceleration and specific force explain.
using Projection = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;

// What is known of the axes: noise of one sample and largest reading, m/s^2.
struct Known {
  Axes noise;
  Axes limit;
  Projection parity;
};

// Samples f[begin:] (n, N), m/s^2, until a block is full or there are no more; the next one's row.
Eigen::Index gather(const Readings& f, Eigen::Index begin, int per_block, Near near, Marks marks, const Known& of,
                    Counts count);

// Variance of the axes' noise over the configured one, by the median axis; 1 where it is not more (H-11).
double measured_noise(const Near& near, const Marks& marks, const Projection& parity);

// What readings are rounded to, m/s^2, where that hides their noise; 0 where it does not (H-14).
double resolution(const Near& near, const Axes& noise);

// Axes that are stuck, at the end of their range, spiking, by counts; true for any. coarse: equal
// readings are usual.
bool flags(const Counts& count, int stuck, int at_limit, int spikes, bool coarse, Flags out);

}  // namespace gyrofree::axis_samples
