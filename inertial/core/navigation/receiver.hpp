// What the fixes show of the receiver's noise, and where they show that the filter is wrong.
#pragma once

#include "navigation/update.hpp"

namespace gyrofree::navigation {

// R by what the fixes before have shown (E-137).
void raise(Measurement& z, const Receiver& receiver);

// What this fix shows, by S before it is used (E-137, E-141). What it has in common with the last one is
// the filter's own error and no noise: their difference is asked, of variance 2 S.
void learn(Receiver& receiver, const Measurement& z, const RowMatrix& S, double adapt);

// Innovations last, which a filter that is right has not (E-141).
bool surely_wrong(const Receiver& receiver);

// Its biases are then what wanders unseen: their variances as of the last measurement grow towards those
// of jumps, m/s^2 and rad/s. Returns whether they did.
bool open_biases(Leg& leg, double jump_accel, double jump_gyro);

}  // namespace gyrofree::navigation
