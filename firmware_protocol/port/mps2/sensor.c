#include "sensor.h"

#include "gf_adxl345.h"

enum { READ = 0x80, MULTIPLE = 0x40, ADDRESS = 0x3F, DATA_READY = 0x80, LAST_DATA = GF_ADXL345_DATAX0 + 5 };

void sensor_power_on(sensor_t *sensor, uint32_t index) {
  for (uint32_t i = 0; i < sizeof sensor->regs; i++) {
    sensor->regs[i] = 0;
  }
  sensor->regs[GF_ADXL345_DEVID] = GF_ADXL345_IDENTITY;
  sensor->regs[GF_ADXL345_INT_SOURCE] = DATA_READY;
  sensor->index = index;
  sensor->reads = 0;
}

static void put(sensor_t *sensor, uint32_t axis, uint32_t value) {
  sensor->regs[GF_ADXL345_DATAX0 + 2u * axis] = (uint8_t)(value & 0xFFu);
  sensor->regs[GF_ADXL345_DATAX0 + 2u * axis + 1u] = (uint8_t)((value >> 8) & 0xFFu);
}

/* x: the number of samples read, so that a test sees each of them; y: which sensor; z: 1 g. */
static void convert(sensor_t *sensor) {
  put(sensor, 0, sensor->reads % 1000u);
  put(sensor, 1, ~sensor->index);
  put(sensor, 2, 256);
}

void sensor_answer(sensor_t *sensor, const uint16_t *out, uint16_t *answer, uint8_t n) {
  const uint32_t command = (uint32_t)out[0] >> 8;
  uint32_t address = command & ADDRESS;
  for (uint32_t i = 0; i < n; i++) {
    answer[i] = 0;
  }
  if ((command & READ) == 0u) {
    sensor->regs[address] = (uint8_t)(out[0] & 0xFFu);
    return;
  }
  convert(sensor);
  for (uint32_t byte = 1; byte < 2u * n; byte++) {
    const uint32_t shift = byte % 2u == 0u ? 8u : 0u;
    answer[byte / 2u] = (uint16_t)(answer[byte / 2u] | ((uint32_t)sensor->regs[address] << shift));
    if (address == LAST_DATA) {
      sensor->reads++;
    }
    address = (command & MULTIPLE) != 0u ? (address + 1u) & ADDRESS : address;
  }
}
