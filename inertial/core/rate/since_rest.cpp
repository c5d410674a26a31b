#include "rate/since_rest.hpp"

namespace gyrofree::rate {

void Block::add(const Block& other) {
  sum += other.sum;
  seconds += other.seconds;
  samples += other.samples;
}

void SinceRest::take(const Sensor& s, const double* a, double dt, bool still, const Filter& f) {
  if (still && !standing_) forget();
  standing_ = still;
  if (!still && !known()) {
    if (count_ > 0) forget();  // not at every sample: it is large
    return;
  }
  if (still) {
    angle_ = f.x(ANGLE);
    angle_variance_ = f.P(ANGLE, ANGLE);
    q_nb_ = f.q_nb;
  }
  if (count_ == 0 || blocks_[count_ - 1].samples >= length_) {
    if (still && count_ >= GUARD_BLOCKS) fold();
    if (count_ == MOST_BLOCKS) coarsen();
    blocks_[count_++] = Block();
  }
  Block& block = blocks_[count_ - 1];
  for (int i = 0; i < s.n; ++i)
    if (std::isfinite(a[i])) block.sum(i) += a[i];
  block.seconds += dt;
  ++block.samples;
  if (block.seconds > LONGEST_S) forget();
}

// The oldest block was of rest for certain.
void SinceRest::fold() {
  rest_.add(blocks_[0]);
  std::move(blocks_.begin() + 1, blocks_.begin() + count_, blocks_.begin());
  --count_;
}

void SinceRest::coarsen() {
  for (int k = 0; k < MOST_BLOCKS / 2; ++k) {
    const Block* pair = &blocks_[k + k];
    Block both = pair[0];
    both.add(pair[1]);
    blocks_[k] = both;
  }
  count_ = MOST_BLOCKS / 2;
  length_ *= 2;
}

}  // namespace gyrofree::rate
