#ifndef GF_ANALOG_H
#define GF_ANALOG_H

/* The analogue accelerometer and gyroscope board: six channels through the 12-bit converter. */

#include "gf_bus.h"

enum { GF_ANALOG_CHANNELS = 6, GF_ANALOG_VREF_MV = 3300, GF_ANALOG_FULL_SCALE = 4095 };

typedef struct {
  const gf_adc_t *adc;
  uint8_t mask;                /* channels in use */
  uint16_t counts[8];          /* by channel, 0..4095 */
  uint32_t missed[8];          /* samples without a new conversion, per channel */
} gf_analog_t;

/* Use these channels, and set the converter going, so that the first sample finds conversions. */
void gf_analog_start(gf_analog_t *analog, uint8_t mask);

/* Take a sample into `counts`; returns the mask of channels with a new conversion. */
uint8_t gf_analog_read(gf_analog_t *analog);

#endif
