#include "gf_analog.h"

void gf_analog_start(gf_analog_t *analog, uint8_t mask) {
  analog->mask = mask;
  for (uint32_t i = 0; i < 8u; i++) {
    analog->counts[i] = 0;
    analog->missed[i] = 0;
  }
  (void)analog->adc->read(analog->adc->context, mask, analog->counts);
}

uint8_t gf_analog_read(gf_analog_t *analog) {
  uint16_t values[8] = {0};
  const uint8_t fresh = (uint8_t)(analog->mask & analog->adc->read(analog->adc->context, analog->mask, values));
  for (uint32_t i = 0; i < 8u; i++) {
    if (((uint32_t)fresh >> i & 1u) != 0u) {
      analog->counts[i] = values[i] > GF_ANALOG_FULL_SCALE ? (uint16_t)GF_ANALOG_FULL_SCALE : values[i];
    } else if (((uint32_t)analog->mask >> i & 1u) != 0u) {
      analog->missed[i]++;
    } else {
      /* not in use */
    }
  }
  return fresh;
}
