// The first state of a products filter: of a body at rest, or of one that turns already (E-36, E-46).
// numpy twin of the fit: tests/support/rate_twin.py.
#pragma once

#include "rate/filter.hpp"
#include "rate/still.hpp"

namespace gyrofree::rate {

constexpr int FEWEST = 8, MOST = 64;  // samples of the first and the last fit
constexpr int FITS[] = {8, 12, 16, 24, 32, 48, 64};  // samples of every fit
constexpr int SURE_FROM = 32;                        // samples; the sign is not decided by fewer

// A filter, and what the fits found of its state at the first sample.
struct Start {
  Filter filter;
  StateVector first = StateVector::Zero();
};

// First state from the mean y of a short standstill (E-36).
void begin_still(Filter& f, const Sensor& s, const Tuning& t, const Measurement& mean);

// Do the products of the newest samples say that the body turns, and not the axes' biases?
bool turns(const Watch& w, const Sensor& s, const Tuning& t);

// States after the newest n samples for both signs of omega, the likelier first. What the fit before
// found of the first sample is where this one begins, unless n is FEWEST. Returns by how much the first
// is likelier, log of the ratio.
double begin_turning(Start& likelier, Start& other, const Watch& w, const Sensor& s, const Tuning& t, int n);

// State one sample y later, by its omega' alone: between two fits.
void carry(Filter& f, const Measurement& y, double dt, const Sensor& s, const Tuning& t);

}  // namespace gyrofree::rate
