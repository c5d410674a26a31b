#include "gf_payload.h"

static void put_bytes(uint8_t *at, const uint8_t *from, size_t size) {
  for (size_t i = 0; i < size; i++) {
    at[i] = from[i];
  }
}

static void put_u32s(uint8_t *at, const uint32_t *values, size_t n) {
  for (size_t i = 0; i < n; i++) {
    gf_put_u32(at + 4u * i, values[i]);
  }
}

static void put_sensor(uint8_t *at, const gf_sensor_info_t *sensor) {
  at[0] = sensor->model;
  at[1] = sensor->bus;
  at[2] = sensor->range_code;
  at[3] = sensor->rate_code;
  gf_put_u32(at + 4, sensor->scale_ng);
}

size_t gf_pack_hello(uint8_t *at, const gf_hello_t *hello) {
  at[GF_HELLO_MINOR] = GF_MINOR;
  at[GF_HELLO_BOARD_ID] = hello->board_id;
  at[GF_HELLO_SENSOR_MASK] = hello->sensor_mask;
  at[GF_HELLO_N_AXES] = hello->n_axes;
  gf_put_u32(at + GF_HELLO_TICK_HZ, hello->tick_hz);
  gf_put_u32(at + GF_HELLO_SAMPLE_PERIOD_NS, hello->sample_period_ns);
  gf_put_u32(at + GF_HELLO_BATCH, hello->batch);
  put_bytes(at + GF_HELLO_UID, hello->uid, sizeof hello->uid);
  put_bytes(at + GF_HELLO_FIRMWARE, hello->firmware, sizeof hello->firmware);
  for (size_t i = 0; i < 3u; i++) {
    gf_put_u16(at + GF_HELLO_VERSION + 2u * i, hello->version[i]);
  }
  gf_put_u16(at + GF_HELLO_CONFIG_CRC, hello->config_crc);
  for (size_t i = 0; i < GF_SENSORS; i++) {
    put_sensor(at + GF_HELLO_SENSORS + 8u * i, &hello->sensors[i]);
  }
  return GF_HELLO_SIZE;
}

size_t gf_pack_status(uint8_t *at, const gf_status_t *status) {
  gf_put_u32(at + GF_STATUS_BUILT, status->built);
  gf_put_u32(at + GF_STATUS_SENT, status->sent);
  gf_put_u32(at + GF_STATUS_DROPPED, status->dropped);
  gf_put_u32(at + GF_STATUS_SAMPLES, status->samples);
  gf_put_u32(at + GF_STATUS_MISSED_TICKS, status->missed_ticks);
  gf_put_u32(at + GF_STATUS_SAMPLE_DROPS, status->sample_drops);
  put_u32s(at + GF_STATUS_SPI_ERRORS, status->spi_errors, GF_SENSORS);
  put_u32s(at + GF_STATUS_INIT_ERRORS, status->init_errors, GF_SENSORS);
  put_u32s(at + GF_STATUS_FIFO_OVERRUNS, status->fifo_overruns, GF_SENSORS);
  gf_put_u32(at + GF_STATUS_TACHO_TOTAL, status->tacho_total);
  gf_put_u32(at + GF_STATUS_TACHO_OVERFLOW, status->tacho_overflow);
  gf_put_u32(at + GF_STATUS_PPS_TOTAL, status->pps_total);
  gf_put_u32(at + GF_STATUS_GPS_BYTES, status->gps_bytes);
  gf_put_u32(at + GF_STATUS_RX_OK, status->rx_ok);
  gf_put_u32(at + GF_STATUS_RX_BAD, status->rx_bad);
  gf_put_u32(at + GF_STATUS_UART_ERRORS, status->uart_errors);
  gf_put_u32(at + GF_STATUS_FREE_STACK, status->free_stack);
  gf_put_u32(at + GF_STATUS_CPU_PERMILLE, status->cpu_permille);
  gf_put_u32(at + GF_STATUS_LAST_SEQ, status->last_seq);
  return GF_STATUS_SIZE;
}

size_t gf_pack_pps(uint8_t *at, uint32_t index, uint32_t fraction_ns, uint16_t flags) {
  gf_put_u32(at + GF_PPS_INDEX, index);
  gf_put_u32(at + GF_PPS_FRACTION_NS, fraction_ns);
  gf_put_u16(at + GF_PPS_FLAGS, flags);
  gf_put_u16(at + GF_PPS_FLAGS + 2, 0);
  return GF_PPS_SIZE;
}

size_t gf_pack_ack(uint8_t *at, uint16_t command, uint16_t token, int16_t status, const uint8_t *echo,
                   size_t echo_size) {
  gf_put_u16(at + GF_ACK_COMMAND, command);
  gf_put_u16(at + GF_ACK_TOKEN, token);
  gf_put_u16(at + GF_ACK_STATUS, (uint16_t)status);
  put_bytes(at + GF_ACK_SIZE, echo, echo_size);
  return GF_ACK_SIZE + echo_size;
}

/* ---- frames with rows ---- */

static void begin(gf_batch_t *batch, uint64_t t_us, uint16_t size) {
  batch->t_us = t_us;
  batch->size = size;
  batch->n = 0;
}

/* Room for one more row of this width, counted at payload[count_at]; NULL when there is none. */
static uint8_t *next_row(gf_batch_t *batch, size_t width, size_t count_at) {
  uint8_t *row = batch->payload + batch->size;
  if (batch->size + width > GF_MAX_PAYLOAD || batch->n == UINT8_MAX) {
    return NULL;
  }
  batch->size = (uint16_t)(batch->size + width);
  batch->n++;
  batch->payload[count_at] = batch->n;
  return row;
}

void gf_acc12_begin(gf_batch_t *batch, uint64_t t_us, uint32_t first_index, uint32_t period_ns, uint8_t sensor_mask) {
  begin(batch, t_us, GF_ACC12_SIZE);
  gf_put_u32(batch->payload + GF_ACC12_FIRST_INDEX, first_index);
  gf_put_u32(batch->payload + GF_ACC12_PERIOD_NS, period_ns);
  batch->payload[GF_ACC12_N] = 0;
  batch->payload[GF_ACC12_SENSOR_MASK] = sensor_mask;
  gf_put_u16(batch->payload + GF_ACC12_STALE_MASK, 0);
}

int gf_acc12_row(gf_batch_t *batch, const int16_t counts[GF_AXES], uint16_t stale_mask) {
  uint8_t *stale = batch->payload + GF_ACC12_STALE_MASK;
  uint8_t *row = next_row(batch, 24, GF_ACC12_N);
  if (row == NULL) {
    return 0;
  }
  for (size_t i = 0; i < GF_AXES; i++) {
    gf_put_u16(row + 2u * i, (uint16_t)counts[i]);
  }
  gf_put_u16(stale, (uint16_t)(gf_get_u16(stale) | stale_mask));
  return 1;
}

void gf_adc_begin(gf_batch_t *batch, uint64_t t_us, uint32_t first_index, uint32_t period_ns, uint8_t channel_mask,
                  uint16_t vref_mv) {
  begin(batch, t_us, GF_ADC_SIZE);
  gf_put_u32(batch->payload + GF_ADC_FIRST_INDEX, first_index);
  gf_put_u32(batch->payload + GF_ADC_PERIOD_NS, period_ns);
  batch->payload[GF_ADC_N] = 0;
  batch->payload[GF_ADC_CHANNEL_MASK] = channel_mask;
  gf_put_u16(batch->payload + GF_ADC_VREF_MV, vref_mv);
}

int gf_adc_row(gf_batch_t *batch, const uint16_t counts[GF_ADC_CHANNELS]) {
  const uint8_t mask = batch->payload[GF_ADC_CHANNEL_MASK];
  size_t width = 0;
  uint8_t *row;
  for (uint32_t i = 0; i < GF_ADC_CHANNELS; i++) {
    width += (size_t)(((uint32_t)mask >> i) & 1u) * 2u;
  }
  row = next_row(batch, width, GF_ADC_N);
  if (row == NULL) {
    return 0;
  }
  for (uint32_t i = 0; i < GF_ADC_CHANNELS; i++) {
    if ((((uint32_t)mask >> i) & 1u) != 0u) {
      gf_put_u16(row, counts[i]);
      row += 2;
    }
  }
  return 1;
}

void gf_imu6_begin(gf_batch_t *batch, uint64_t t_us, uint32_t first_index, uint32_t period_ns, uint32_t accel_scale_ug,
                   uint32_t gyro_scale_nrad) {
  begin(batch, t_us, GF_IMU6_SIZE);
  gf_put_u32(batch->payload + GF_IMU6_FIRST_INDEX, first_index);
  gf_put_u32(batch->payload + GF_IMU6_PERIOD_NS, period_ns);
  gf_put_u32(batch->payload + GF_IMU6_ACCEL_SCALE_UG, accel_scale_ug);
  gf_put_u32(batch->payload + GF_IMU6_GYRO_SCALE_NRAD, gyro_scale_nrad);
  gf_put_u32(batch->payload + GF_IMU6_N, 0); /* n and what is reserved behind it */
}

int gf_imu6_row(gf_batch_t *batch, const int32_t counts[6]) {
  uint8_t *row = next_row(batch, 24, GF_IMU6_N);
  if (row == NULL) {
    return 0;
  }
  for (size_t i = 0; i < 6u; i++) {
    gf_put_u32(row + 4u * i, (uint32_t)counts[i]);
  }
  return 1;
}

void gf_tacho_begin(gf_batch_t *batch, uint64_t t_us, uint32_t first_pulse, uint8_t edge) {
  begin(batch, t_us, GF_TACHO_SIZE);
  gf_put_u32(batch->payload + GF_TACHO_FIRST_PULSE, first_pulse);
  gf_put_u32(batch->payload + GF_TACHO_N, 0); /* n and what is reserved behind it */
  batch->payload[GF_TACHO_EDGE] = edge;
}

int gf_tacho_pulse(gf_batch_t *batch, uint32_t offset_10ns) {
  uint8_t *row = next_row(batch, 4, GF_TACHO_N);
  if (row == NULL) {
    return 0;
  }
  gf_put_u32(row, offset_10ns);
  return 1;
}

void gf_gps_begin(gf_batch_t *batch, uint64_t t_us) { begin(batch, t_us, GF_GPS_SIZE); }

int gf_gps_byte(gf_batch_t *batch, uint8_t byte) {
  if (batch->size >= GF_MAX_PAYLOAD) {
    return 0;
  }
  batch->payload[batch->size] = byte;
  batch->size++;
  return 1;
}
