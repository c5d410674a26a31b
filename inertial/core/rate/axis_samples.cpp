#include "rate/axis_samples.hpp"

#include <algorithm>
#include <cmath>

namespace gyrofree::axis_samples {
namespace {

using Index = Eigen::Index;

constexpr std::int64_t AGE_LONG = 1'000'000;
// of a sample against the middle of its neighbours, whose own noise is sqrt(1.5) of a sample's
constexpr double SPIKE_SIGMAS = 9.0;
constexpr double SPIKE_OF_MEDIAN = 6.0;  // a knock moves all axes: a spike stands out from the median axis
constexpr double SPIKE_STEP = 0.6;       // its neighbours agree to this part of its height
constexpr std::int64_t SPIKE_MEMORY = 200;  // samples; spikes farther apart do not add up
constexpr double AT_END = 0.998;            // of the range

void count_one(Index i, double f, double last, bool known, double limit, Counts& count) {
  count(SAME, i) = known && f == last ? count(SAME, i) + 1 : 0;
  if (std::abs(f) >= AT_END * limit) {
    count(AT_LIMIT, i) += 1;
    count(LIMIT_AGE, i) = 0;
  } else {
    count(AT_LIMIT, i) = 0;
    count(LIMIT_AGE, i) = std::min(count(LIMIT_AGE, i) + 1, AGE_LONG);
  }
  count(SPIKE_AGE, i) = std::min(count(SPIKE_AGE, i) + 1, AGE_LONG);
  if (count(SPIKE_AGE, i) > SPIKE_MEMORY) count(SPIKES, i) = 0;
}

double median(parity::Axes values) {
  double* begin = values.data();
  const Index n = values.size();
  std::sort(begin, begin + n);
  return 0.5 * (values((n - 1) / 2) + values(n / 2));
}

// The last sample with spikes replaced by the middle of their neighbours.
parity::Axes without_spikes(const parity::Axes& f, const Near& near, const Axes& noise, Counts& count) {
  parity::Axes clean = near.row(LAST).transpose(), off(f.size());
  for (Index i = 0; i < f.size(); ++i) off(i) = std::abs(near(LAST, i) - 0.5 * (f(i) + near(BEFORE, i)));
  const double usual = SPIKE_OF_MEDIAN * median(off);
  for (Index i = 0; i < f.size(); ++i) {
    const bool stands_out = off(i) > std::max(SPIKE_SIGMAS * noise(i), usual);
    if (!stands_out || !(std::abs(f(i) - near(BEFORE, i)) < SPIKE_STEP * off(i))) continue;
    count(SPIKES, i) += 1;
    count(SPIKE_AGE, i) = 0;
    clean(i) = 0.5 * (f(i) + near(BEFORE, i));
  }
  return clean;
}

}  // namespace

Index gather(const Readings& f, Index begin, int per_block, Near near, Marks marks, const Axes& noise,
             const Axes& limit, Counts count) {
  for (Index k = begin; k < f.rows(); ++k) {
    const parity::Axes now = f.row(k).transpose();
    for (Index i = 0; i < now.size(); ++i) count_one(i, now(i), near(LAST, i), marks(KNOWN) >= 1, limit(i), count);
    parity::Axes clean = near.row(LAST).transpose();
    if (marks(KNOWN) == 2) clean = without_spikes(now, near, noise, count);
    if (marks(KNOWN) > 0) {
      near.row(SUM) += clean.transpose();
      marks(FILLED) += 1;
    }
    near.row(BEFORE) = clean.transpose();
    near.row(LAST) = now.transpose();
    marks(KNOWN) = std::min<std::int64_t>(marks(KNOWN) + 1, 2);
    if (marks(FILLED) >= per_block) return k + 1;
  }
  return f.rows();
}

bool flags(const Counts& count, int stuck, int at_limit, int spikes, Flags out) {
  const Index n = count.cols();
  Index standing = 0;
  for (Index i = 0; i < n; ++i) {
    out(STUCK, i) = count(SAME, i) >= stuck;
    out(LIMIT, i) = count(AT_LIMIT, i) >= at_limit;
    out(SPIKING, i) = count(SPIKES, i) >= spikes;
    standing += out(STUCK, i) ? 1 : 0;
  }
  if (standing * 2 > n) out.row(STUCK).setConstant(false);  // a source without noise, not a fault
  return out.any();
}

}  // namespace gyrofree::axis_samples
