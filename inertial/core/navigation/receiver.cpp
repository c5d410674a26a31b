#include "navigation/receiver.hpp"

#include <algorithm>

#include "common/elementary.hpp"

namespace gyrofree::navigation {
namespace {

constexpr double MOST_NEWS = 4.0;  // NIS per row that one fix may show: a gross one is no noise
constexpr double MOST_NOISE = 1000.0;
constexpr double SURELY_WRONG = 3.0;  // disagreement that chance does not reach

void follow(double& noise, double nis_per_row, double adapt) {
  const double news = std::min(nis_per_row, MOST_NEWS) - 1.0;
  noise = std::clamp(noise * (1.0 + adapt * news), 1.0, MOST_NOISE);
}

// Where white innovations average out and a wrong filter's do not (E-141). `y` over sigma.
void doubt(Receiver& receiver, const Vector3& y, int said) {
  constexpr double SHARE = 0.2, OF_WHITE = SHARE / (2.0 - SHARE), MOST = 25.0;
  constexpr double GROSS = 3.0;  // sigmas of one that count: an outlier does not last
  receiver.lasting += SHARE * (y.cwiseMin(GROSS).cwiseMax(-GROSS) - receiver.lasting);
  const double now = std::min(square_of(receiver.lasting) / (said * OF_WHITE), MOST);
  receiver.disagreement += SHARE * (now - receiver.disagreement);
}

}  // namespace

void raise(Measurement& z, const Receiver& receiver) {
  for (const auto& [group, first, size] : blocks_of(z.rows())) {
    if (group == POSITION) z.R.block(first, first, size, size) *= receiver.position;
    if (group == VELOCITY) z.R.block(first, first, size, size) *= receiver.velocity;
  }
}

void learn(Receiver& receiver, const Measurement& z, const RowMatrix& S, double adapt) {
  for (const auto& [group, first, size] : blocks_of(z.rows())) {
    int said = 0;
    for (int r = first; r < first + size; ++r) said += is_silent(z, r) ? 0 : 1;
    if (said == 0 || group == HEADING) continue;
    const Vector3 y = z.y.segment<3>(first);
    Vector3& last = group == POSITION ? receiver.last_position : receiver.last_velocity;
    const RowMatrix block = S.block(first, first, size, size);
    double nis = 0.5 * whiten(block, y - last).nis;
    if (nis > MOST_NEWS * said) nis = std::min(nis, whiten(block, y).nis);  // a gross one counts once
    if (nis >= 0.0) follow(group == POSITION ? receiver.position : receiver.velocity, nis / said, adapt);
    last = y;
    if (group != VELOCITY) continue;
    const RowVector sigma = S.diagonal().segment<3>(first).cwiseSqrt();
    doubt(receiver, y.cwiseQuotient(Vector3(sigma)), said);
  }
}

bool surely_wrong(const Receiver& receiver) { return receiver.disagreement > SURELY_WRONG; }

bool open_biases(Leg& leg, double jump_accel, double jump_gyro) {
  constexpr double SHARE = 0.2;  // of what may be, for each unit of disagreement above SURE
  const double share = std::min(1.0, SHARE * (leg.receiver.disagreement - SURELY_WRONG));
  if (!(share > 0.0)) return false;
  for (int i = 0; i < 3; ++i) {
    double &accel = leg.P(BIAS_ACCEL + i, BIAS_ACCEL + i), &gyro = leg.P(BIAS_GYRO + i, BIAS_GYRO + i);
    accel += share * std::max(0.0, jump_accel * jump_accel - accel);
    gyro += share * std::max(0.0, jump_gyro * jump_gyro - gyro);
  }
  return true;
}

}  // namespace gyrofree::navigation
