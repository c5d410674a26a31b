#include "gf_ring.h"

void gf_ring_start(gf_ring_t *ring, volatile uint8_t *bytes, uint32_t size) {
  ring->bytes = bytes;
  ring->size = size;
  ring->put = 0;
  ring->taken = 0;
  ring->lost = 0;
}

uint32_t gf_ring_used(const gf_ring_t *ring) {
  const uint32_t put = ring->put;
  return put - ring->taken;
}

int gf_ring_put(gf_ring_t *ring, uint8_t byte) {
  const uint32_t put = ring->put;
  if (gf_ring_used(ring) >= ring->size) {
    ring->lost++;
    return 0;
  }
  ring->bytes[put & (ring->size - 1u)] = byte;
  ring->put = put + 1u;
  return 1;
}

int gf_ring_put_all(gf_ring_t *ring, const uint8_t *bytes, size_t size) {
  const uint32_t put = ring->put;
  if (size > ring->size - gf_ring_used(ring)) {
    return 0;
  }
  for (size_t i = 0; i < size; i++) {
    ring->bytes[(put + i) & (ring->size - 1u)] = bytes[i];
  }
  ring->put = put + (uint32_t)size;
  return 1;
}

size_t gf_ring_take(gf_ring_t *ring, uint8_t *bytes, size_t size) {
  const uint32_t taken = ring->taken;
  const uint32_t used = gf_ring_used(ring);
  const size_t n = used < size ? used : size;
  for (size_t i = 0; i < n; i++) {
    bytes[i] = ring->bytes[(taken + i) & (ring->size - 1u)];
  }
  ring->taken = taken + (uint32_t)n;
  return n;
}

void gf_pulses_put(gf_pulses_t *pulses, uint64_t ticks, uint8_t edge) {
  const uint32_t put = pulses->put;
  const uint32_t taken = pulses->taken;
  if (put - taken >= (uint32_t)GF_PULSES) {
    pulses->lost++;
  } else {
    pulses->pulses[put % (uint32_t)GF_PULSES].ticks = ticks;
    pulses->pulses[put % (uint32_t)GF_PULSES].index = put + pulses->lost;
    pulses->pulses[put % (uint32_t)GF_PULSES].edge = edge;
    pulses->put = put + 1u;
  }
}

int gf_pulses_next(void *context, gf_pulse_t *pulse) {
  gf_pulses_t *pulses = context;
  const uint32_t taken = pulses->taken;
  const uint32_t put = pulses->put;
  if (put == taken) {
    return 0;
  }
  pulse->ticks = pulses->pulses[taken % (uint32_t)GF_PULSES].ticks;
  pulse->index = pulses->pulses[taken % (uint32_t)GF_PULSES].index;
  pulse->edge = pulses->pulses[taken % (uint32_t)GF_PULSES].edge;
  pulses->taken = taken + 1u;
  return 1;
}

uint32_t gf_pulses_overflows(void *context) {
  const gf_pulses_t *pulses = context;
  return pulses->lost;
}
