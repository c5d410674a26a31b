#ifndef GF_PAYLOAD_H
#define GF_PAYLOAD_H

/*
 * Payloads of the frames a device sends: fields to bytes, as spec.toml orders them.
 *
 * Frames with rows are filled where they will be sent from: begin, then a row at a time.  C99, no heap, no globals,
 * no library calls.
 */

#include <stddef.h>
#include <stdint.h>

#include "gf_frame.h"

enum {
  GF_SENSORS = 4,
  GF_AXES = 12,
  GF_ADC_CHANNELS = 8,
  GF_ACC12_MAX_ROWS = (GF_MAX_PAYLOAD - GF_ACC12_SIZE) / 24,
  GF_IMU6_MAX_ROWS = (GF_MAX_PAYLOAD - GF_IMU6_SIZE) / 24,
  GF_TACHO_MAX_PULSES = (GF_MAX_PAYLOAD - GF_TACHO_SIZE) / 4,
  GF_ACK_MAX_ECHO = 32 /* bytes; the longest is that of self_test */
};

typedef struct {
  uint8_t model;      /* 0 none, 1 ADXL345, 2 six-axis IMU, 3 analogue */
  uint8_t bus;        /* SPI bus number */
  uint8_t range_code; /* range register of the sensor */
  uint8_t rate_code;  /* rate register of the sensor */
  uint32_t scale_ng;  /* 1e-9 g per count */
} gf_sensor_info_t;

typedef struct {
  uint8_t board_id;
  uint8_t sensor_mask;
  uint8_t n_axes;
  uint32_t tick_hz;
  uint32_t sample_period_ns;
  uint32_t batch;
  uint8_t uid[16];
  uint8_t firmware[20];
  uint16_t version[3];
  uint16_t config_crc;
  gf_sensor_info_t sensors[GF_SENSORS];
} gf_hello_t;

/* See STATUS in spec.toml; all counters wrap at 2^32. */
typedef struct {
  uint32_t built;
  uint32_t sent;
  uint32_t dropped;
  uint32_t samples;
  uint32_t missed_ticks;
  uint32_t sample_drops;
  uint32_t spi_errors[GF_SENSORS];
  uint32_t init_errors[GF_SENSORS];
  uint32_t fifo_overruns[GF_SENSORS];
  uint32_t tacho_total;
  uint32_t tacho_overflow;
  uint32_t pps_total;
  uint32_t gps_bytes;
  uint32_t rx_ok;
  uint32_t rx_bad;
  uint32_t uart_errors;
  uint32_t free_stack;
  uint32_t cpu_permille;
  uint32_t last_seq;
} gf_status_t;

/* Write a payload to at[0 .. result); at holds GF_HELLO_SIZE, GF_STATUS_SIZE, ... bytes. */
size_t gf_pack_hello(uint8_t *at, const gf_hello_t *hello);
size_t gf_pack_status(uint8_t *at, const gf_status_t *status);
size_t gf_pack_pps(uint8_t *at, uint32_t index, uint32_t fraction_ns, uint16_t flags);

/* at holds GF_ACK_SIZE + GF_ACK_MAX_ECHO bytes; echo_size is at most GF_ACK_MAX_ECHO. */
size_t gf_pack_ack(uint8_t *at, uint16_t command, uint16_t token, int16_t status, const uint8_t *echo,
                   size_t echo_size);

/* A payload that is being filled; n rows so far, t_us of the first. */
typedef struct {
  uint8_t payload[GF_MAX_PAYLOAD];
  uint16_t size;
  uint8_t n;
  uint64_t t_us;
} gf_batch_t;

void gf_acc12_begin(gf_batch_t *batch, uint64_t t_us, uint32_t first_index, uint32_t period_ns, uint8_t sensor_mask);
void gf_adc_begin(gf_batch_t *batch, uint64_t t_us, uint32_t first_index, uint32_t period_ns, uint8_t channel_mask,
                  uint16_t vref_mv);
void gf_imu6_begin(gf_batch_t *batch, uint64_t t_us, uint32_t first_index, uint32_t period_ns, uint32_t accel_scale_ug,
                   uint32_t gyro_scale_nrad);
void gf_tacho_begin(gf_batch_t *batch, uint64_t t_us, uint32_t first_pulse, uint8_t edge);
void gf_gps_begin(gf_batch_t *batch, uint64_t t_us);

/* Each returns 1, or 0 when the payload is full and nothing was added. */
int gf_acc12_row(gf_batch_t *batch, const int16_t counts[GF_AXES], uint16_t stale_mask);
int gf_adc_row(gf_batch_t *batch, const uint16_t counts[GF_ADC_CHANNELS]); /* by channel; masked ones are taken */
int gf_imu6_row(gf_batch_t *batch, const int32_t counts[6]);
int gf_tacho_pulse(gf_batch_t *batch, uint32_t offset_10ns);
int gf_gps_byte(gf_batch_t *batch, uint8_t byte);

#endif
