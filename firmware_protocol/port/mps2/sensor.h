#ifndef SENSOR_H
#define SENSOR_H

/* A still ADXL345: QEMU's board has nothing on its SPI buses. */

#include <stdint.h>

typedef struct {
  uint8_t regs[64];
  uint32_t index; /* which of the four */
  uint32_t reads; /* samples read */
} sensor_t;

void sensor_power_on(sensor_t *sensor, uint32_t index);

/* What it answers to n words. */
void sensor_answer(sensor_t *sensor, const uint16_t *out, uint16_t *answer, uint8_t n);

#endif
