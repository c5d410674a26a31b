// What a car's wheels say: no sideways or vertical speed under way, no speed and no rate at
// standstill (E-120, E-121). All limits and sigmas are data.
#pragma once

#include "navigation/update.hpp"

namespace gyrofree::navigation {

constexpr double MOST_MOVED = 3.0;  // of Leg::moved: then it hovers or drifts: quiet, but no standstill

struct Rules {
  double every = 0.0;           // s between two looks; infinite: never
  double sigma_side = 0.0;      // m/s
  double sigma_up = 0.0;        // m/s
  double least_speed = 0.0;     // m/s, below which wheels say nothing of the direction
  double most_turn = 0.0;       // rad/s, above which tyres slip
  double still_v = 0.0;         // m/s, sigma of zero velocity
  double still_w = 0.0;         // rad/s, sigma of zero rate
  double still_speed = 0.0;     // m/s, the filter's own speed above which nothing is a standstill
  double still_f_change = 0.0;  // m/s^2, largest standard deviation of tick means at standstill
  double still_w_change = 0.0;  // rad/s, likewise
  double huber = 0.0;           // Mahalanobis distance from which a constraint is weighted down

  template <class Self, class Visitor>
  static void visit(Self& s, Visitor& v) {
    v("every", s.every), v("sigma_side", s.sigma_side), v("sigma_up", s.sigma_up);
    v("least_speed", s.least_speed), v("most_turn", s.most_turn);
    v("still_v", s.still_v), v("still_w", s.still_w), v("still_speed", s.still_speed);
    v("still_f_change", s.still_f_change), v("still_w_change", s.still_w_change), v("huber", s.huber);
  }
};

// Does the last second look like a standstill: quiet readings, no turn, no speed? (E-121)
bool standing(const Leg& leg, const Rules& rules);
// What holds now; no rows: nothing.
Measurement constraint(const Leg& leg, const Model& model, const Rules& rules);
// Applies what holds now and starts a new leg; `error` gets the estimate. False: nothing held.
bool constrain(Leg& leg, const Model& model, const Rules& rules, StateVector& error);

}  // namespace gyrofree::navigation
