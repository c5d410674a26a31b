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
constexpr double SPIKE_OF_USUAL = 6.0;  // of what is usual of the axis: vibration is no spike
constexpr Index MOST_SPIKES = 2;        // axes in one sample: more of them are a motion
constexpr double USUAL_LATELY = 1.0 / 32.0;  // weight of one sample in what is usual
constexpr double USUAL_CLIP = 3.0;
constexpr double THIRD = 20.0;  // variance of a third difference of white noise over the noise's own
constexpr std::int64_t MEMORY = 256;  // samples in the measured noise
constexpr double CLIP = 6.0;          // of one sample over the mean so far: a jolt is no noise
constexpr double LEAST_SEEN = 0.05;   // share of an axis' noise that must be in the parity residual
constexpr double MEDIAN_OF_SQUARES = 0.9;  // median over axes of such means, over their true mean
constexpr double COARSE = 2.0;  // times the noise: readings stay equal for long where it is rounded to more
constexpr double SLACK = 0.25;  // by which chance alone exceeds 1 over MEMORY samples

void count_one(Index i, double f, bool known, double limit, Near& near, Counts& count) {
  const double change = known ? std::abs(f - near(LAST, i)) : 0.0;
  count(SAME, i) = known && change == 0.0 ? count(SAME, i) + 1 : 0;
  if (change > 0.0) near(CHANGE, i) = near(CHANGE, i) > 0.0 ? std::min(near(CHANGE, i), change) : change;
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
parity::Axes without_spikes(const parity::Axes& f, Near& near, const Axes& noise, Counts& count) {
  parity::Axes clean = near.row(LAST).transpose(), off(f.size());
  for (Index i = 0; i < f.size(); ++i) off(i) = std::abs(near(LAST, i) - 0.5 * (f(i) + near(BEFORE, i)));
  const double usual = SPIKE_OF_MEDIAN * median(off);
  parity::Mask spike(f.size());
  for (Index i = 0; i < f.size(); ++i) {
    const double least = std::max(SPIKE_SIGMAS * noise(i), SPIKE_OF_USUAL * near(USUAL, i));
    spike(i) = off(i) > std::max(least, usual) && std::abs(f(i) - near(BEFORE, i)) < SPIKE_STEP * off(i);
    const double most = std::max(USUAL_CLIP * near(USUAL, i), SPIKE_SIGMAS * noise(i));
    near(USUAL, i) += USUAL_LATELY * (std::min(off(i), most) - near(USUAL, i));
  }
  if (spike.count() > MOST_SPIKES) return clean;
  for (Index i = 0; i < f.size(); ++i) {
    if (!spike(i)) continue;
    count(SPIKES, i) += 1;
    count(SPIKE_AGE, i) = 0;
    clean(i) = 0.5 * (f(i) + near(BEFORE, i));
  }
  return clean;
}

// Third differences of the axes, without motion, into their running means (H-11).
void hear(const parity::Axes& now, const parity::Axes& last, Near& near, Marks& marks, const Known& of) {
  const Index n = now.size();
  parity::Axes third(n);
  for (Index i = 0; i < n; ++i) third(i) = now(i) - near(EARLIER, i) + 3.0 * (near(BEFORE, i) - last(i));
  const parity::Axes left = product(of.parity, third);
  marks(HEARD) = std::min<std::int64_t>(marks(HEARD) + 1, MEMORY);
  for (Index i = 0; i < n; ++i) {
    const double share = of.parity(i, i);
    if (share < LEAST_SEEN) continue;
    const double ratio = square(left(i)) / (THIRD * share * square(of.noise(i)));
    const double most = CLIP * std::max(near(PARITY, i), 1.0);
    near(PARITY, i) += (std::min(ratio, most) - near(PARITY, i)) / static_cast<double>(marks(HEARD));
  }
}

}  // namespace

double measured_noise(const Near& near, const Marks& marks, const Projection& parity) {
  const Index n = near.cols();
  parity::Axes seen(n);
  Index axes = 0;
  for (Index i = 0; i < n; ++i)
    if (parity(i, i) >= LEAST_SEEN) seen(axes++) = near(PARITY, i);
  if (axes == 0 || marks(HEARD) == 0) return 1.0;
  const double ratio = median(seen.head(axes)) / MEDIAN_OF_SQUARES;
  const double chance = SLACK * std::sqrt(static_cast<double>(MEMORY) / static_cast<double>(marks(HEARD)));
  return ratio < 1.0 + chance ? 1.0 : ratio;
}

Index gather(const Readings& f, Index begin, int per_block, Near near, Marks marks, const Known& of,
             Counts count) {
  for (Index k = begin; k < f.rows(); ++k) {
    const parity::Axes now = f.row(k).transpose();
    for (Index i = 0; i < now.size(); ++i) count_one(i, now(i), marks(KNOWN) >= 1, of.limit(i), near, count);
    parity::Axes clean = near.row(LAST).transpose();
    if (marks(KNOWN) >= 2) clean = without_spikes(now, near, of.noise, count);
    if (marks(KNOWN) == 3) hear(now, clean, near, marks, of);
    if (marks(KNOWN) > 0) {
      near.row(SUM) += clean.transpose();
      marks(FILLED) += 1;
    }
    near.row(EARLIER) = near.row(BEFORE);
    near.row(BEFORE) = clean.transpose();
    near.row(LAST) = now.transpose();
    marks(KNOWN) = std::min<std::int64_t>(marks(KNOWN) + 1, 3);
    if (marks(FILLED) >= per_block) return k + 1;
  }
  return f.rows();
}

double resolution(const Near& near, const Axes& noise) {
  parity::Axes change(near.cols()), sigma(near.cols());
  Index axes = 0;
  for (Index i = 0; i < near.cols(); ++i) {
    if (near(CHANGE, i) == 0.0) continue;
    change(axes) = near(CHANGE, i);
    sigma(axes++) = noise(i);
  }
  if (2 * axes < near.cols()) return 0.0;
  const double middle = median(change.head(axes));
  return middle > COARSE * median(sigma.head(axes)) ? middle : 0.0;
}

bool flags(const Counts& count, int stuck, int at_limit, int spikes, bool coarse, Flags out) {
  const Index n = count.cols();
  Index standing = 0;
  for (Index i = 0; i < n; ++i) {
    out(STUCK, i) = !coarse && count(SAME, i) >= stuck;
    out(LIMIT, i) = count(AT_LIMIT, i) >= at_limit;
    out(SPIKING, i) = count(SPIKES, i) >= spikes;
    standing += out(STUCK, i) ? 1 : 0;
  }
  if (standing * 2 > n) out.row(STUCK).setConstant(false);  // a source without noise, not a fault
  return out.any();
}

}  // namespace gyrofree::axis_samples
