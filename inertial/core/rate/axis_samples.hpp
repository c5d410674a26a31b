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
// Readings that are kept between samples: the last but one, the last, and the sum of the block.
enum Kept : int { BEFORE, LAST, SUM, KEPT };
// Marks: how many of BEFORE and LAST are known, and samples in the block.
enum Mark : int { KNOWN, FILLED, MARKS };
enum Flag : int { STUCK, LIMIT, SPIKING, FLAGS };

using Readings = Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>>;
using Near = Eigen::Map<Eigen::Matrix<double, KEPT, Eigen::Dynamic, Eigen::RowMajor>>;
using Counts = Eigen::Map<Eigen::Matrix<std::int64_t, COUNTERS, Eigen::Dynamic, Eigen::RowMajor>>;
using Marks = Eigen::Map<Eigen::Matrix<std::int64_t, MARKS, 1>>;
using Flags = Eigen::Map<Eigen::Array<bool, FLAGS, Eigen::Dynamic, Eigen::RowMajor>>;
using Axes = Eigen::Map<const Eigen::VectorXd>;

// Samples f[begin:] (n, N), m/s^2, until a block is full or there are no more; the next one's row.
Eigen::Index gather(const Readings& f, Eigen::Index begin, int per_block, Near near, Marks marks, const Axes& noise,
                    const Axes& limit, Counts count);

// Axes that are stuck, at the end of their range, spiking, by counts; true for any.
bool flags(const Counts& count, int stuck, int at_limit, int spikes, Flags out);

}  // namespace gyrofree::axis_samples
