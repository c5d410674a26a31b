/*
 * Runs the C core over what a test sends on stdin, and prints what it made of it.
 *
 *   decode   u32 size, bytes; again ...      one line per event, then "P pending" for each stream
 *   pack     lines "type value value ...", the fields of a payload in the order of the wire       one hex line each
 *   encode   u8 type, epoch, flags, u32 seq, u64 t_us, u16 size, payload; again ...    one hex line per frame
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gf_command.h"
#include "gf_frame.h"
#include "gf_payload.h"

static void print_hex(const uint8_t *data, size_t size) {
  for (size_t i = 0; i < size; i++) {
    printf("%02x", data[i]);
  }
  printf("\n");
}

static uint8_t *read_exactly(size_t size) {
  /* exactly this much on the heap, so that the sanitizer sees one byte too many */
  uint8_t *data = malloc(size ? size : 1u);
  if (data == NULL || fread(data, 1, size, stdin) != size) {
    fprintf(stderr, "input ends inside a record of %zu bytes\n", size);
    exit(2);
  }
  return data;
}

static void decode_stream(const uint8_t *data, size_t size) {
  gf_decoder_t decoder = {0};
  for (size_t i = 0; i < size; i++) {
    switch (gf_push(&decoder, data[i])) {
      case GF_FRAME:
        printf("F %u %u %u %lu %llu %u ", decoder.header.type, decoder.header.epoch, decoder.header.flags,
               (unsigned long)decoder.header.seq, (unsigned long long)decoder.header.t_us, decoder.wire_size);
        print_hex(decoder.payload, decoder.payload_size);
        break;
      case GF_DAMAGED:
        printf("D %d %u\n", (int)decoder.reason, decoder.wire_size);
        break;
      case GF_MORE:
        break;
    }
  }
  printf("P %zu\n", gf_pending(&decoder));
}

static void decode_all(void) {
  uint8_t length[4];
  while (fread(length, 1, sizeof length, stdin) == sizeof length) {
    uint8_t *data = read_exactly(gf_get_u32(length));
    decode_stream(data, gf_get_u32(length));
    free(data);
  }
}

static void encode_all(void) {
  uint8_t record[17];
  while (fread(record, 1, sizeof record, stdin) == sizeof record) {
    const gf_header_t header = {record[0], record[1], record[2], gf_get_u32(record + 3), gf_get_u64(record + 7)};
    const size_t size = gf_get_u16(record + 15);
    const size_t capacity = gf_encoded_bound(size);
    uint8_t *payload = read_exactly(size);
    uint8_t *wire = malloc(capacity);
    if (wire == NULL) {
      exit(2);
    }
    if (gf_encode(wire, capacity - 1u, &header, payload, size) != 0u) {
      printf("wrote into %zu bytes, bound is %zu\n", capacity - 1u, capacity);
    }
    print_hex(wire, gf_encode(wire, capacity, &header, payload, size));
    free(wire);
    free(payload);
  }
}

/* ---- pack: what the builders make of fields ---- */

static int64_t values[2048];
static size_t at;

static int64_t next(void) { return values[at++]; }

static uint32_t u32(void) { return (uint32_t)next(); }

static uint16_t u16(void) { return (uint16_t)next(); }

static uint8_t u8(void) { return (uint8_t)next(); }

static size_t pack_hello(uint8_t *payload) {
  gf_hello_t hello;
  (void)u8(); /* minor is the core's own */
  hello.board_id = u8();
  hello.sensor_mask = u8();
  hello.n_axes = u8();
  hello.tick_hz = u32();
  hello.sample_period_ns = u32();
  hello.batch = u32();
  for (size_t i = 0; i < sizeof hello.uid; i++) {
    hello.uid[i] = u8();
  }
  for (size_t i = 0; i < sizeof hello.firmware; i++) {
    hello.firmware[i] = u8();
  }
  for (size_t i = 0; i < 3u; i++) {
    hello.version[i] = u16();
  }
  hello.config_crc = u16();
  for (size_t i = 0; i < GF_SENSORS; i++) {
    hello.sensors[i].model = u8();
    hello.sensors[i].bus = u8();
    hello.sensors[i].range_code = u8();
    hello.sensors[i].rate_code = u8();
    hello.sensors[i].scale_ng = u32();
  }
  return gf_pack_hello(payload, &hello);
}

static size_t pack_status(uint8_t *payload) {
  gf_status_t s;
  uint32_t *const before[] = {&s.built, &s.sent, &s.dropped, &s.samples, &s.missed_ticks, &s.sample_drops};
  uint32_t *const fours[] = {s.spi_errors, s.init_errors, s.fifo_overruns};
  uint32_t *const behind[] = {&s.tacho_total, &s.tacho_overflow, &s.pps_total, &s.gps_bytes, &s.rx_ok, &s.rx_bad,
                              &s.uart_errors, &s.free_stack, &s.cpu_permille, &s.last_seq};
  for (size_t i = 0; i < sizeof before / sizeof *before; i++) {
    *before[i] = u32();
  }
  for (size_t i = 0; i < 12u; i++) {
    fours[i / 4u][i % 4u] = u32();
  }
  for (size_t i = 0; i < sizeof behind / sizeof *behind; i++) {
    *behind[i] = u32();
  }
  return gf_pack_status(payload, &s);
}

static size_t pack_acc12(gf_batch_t *batch, size_t n) {
  const uint32_t first = u32();
  const uint32_t period = u32();
  const uint8_t mask = u8();
  const uint16_t stale = u16();
  gf_acc12_begin(batch, 0, first, period, mask);
  while (at < n) {
    int16_t row[GF_AXES];
    for (size_t i = 0; i < GF_AXES; i++) {
      row[i] = (int16_t)next();
    }
    if (!gf_acc12_row(batch, row, stale)) {
      return 0;
    }
  }
  return batch->n != 0u || stale == 0u ? batch->size : 0u; /* without rows nothing can be stale */
}

static size_t pack_adc(gf_batch_t *batch, size_t n) {
  const uint32_t first = u32();
  const uint32_t period = u32();
  const uint8_t mask = u8();
  gf_adc_begin(batch, 0, first, period, mask, u16());
  while (at < n) {
    uint16_t row[GF_ADC_CHANNELS] = {0};
    for (size_t i = 0; i < GF_ADC_CHANNELS; i++) {
      if ((mask >> i) & 1) {
        row[i] = u16();
      }
    }
    if (!gf_adc_row(batch, row)) {
      return 0;
    }
  }
  return batch->size;
}

static size_t pack_imu6(gf_batch_t *batch, size_t n) {
  const uint32_t first = u32();
  const uint32_t period = u32();
  const uint32_t accel = u32();
  gf_imu6_begin(batch, 0, first, period, accel, u32());
  while (at < n) {
    int32_t row[6];
    for (size_t i = 0; i < 6u; i++) {
      row[i] = (int32_t)next();
    }
    if (!gf_imu6_row(batch, row)) {
      return 0;
    }
  }
  return batch->size;
}

static size_t pack_tacho(gf_batch_t *batch, size_t n) {
  const uint32_t first = u32();
  gf_tacho_begin(batch, 0, first, u8());
  while (at < n) {
    if (!gf_tacho_pulse(batch, u32())) {
      return 0;
    }
  }
  return batch->size;
}

static size_t pack_gps(gf_batch_t *batch, size_t n) {
  gf_gps_begin(batch, 0);
  while (at < n) {
    if (!gf_gps_byte(batch, u8())) {
      return 0;
    }
  }
  return batch->size;
}

static size_t pack_pps(uint8_t *payload) {
  const uint32_t index = u32();
  const uint32_t fraction = u32();
  return gf_pack_pps(payload, index, fraction, u16());
}

static size_t pack_ack(uint8_t *payload, size_t n) {
  uint8_t echo[GF_ACK_MAX_ECHO];
  const uint16_t command = u16();
  const uint16_t token = u16();
  const int16_t status = (int16_t)next();
  size_t size = 0;
  while (at < n && size < sizeof echo) {
    echo[size++] = u8();
  }
  return gf_pack_ack(payload, command, token, status, echo, size);
}

/* A CMD's fields as bytes of the host, read by the device and written again. */
static size_t pack_cmd(uint8_t *payload, size_t n) {
  uint8_t bytes[GF_MAX_PAYLOAD] = {0};
  size_t size = GF_CMD_SIZE;
  gf_command_t command;
  gf_put_u16(bytes + GF_CMD_COMMAND, u16());
  gf_put_u16(bytes + GF_CMD_TOKEN, u16());
  while (at < n) {
    bytes[size++] = u8();
  }
  if (!gf_command_parse(&command, bytes, size)) {
    return 0;
  }
  gf_put_u16(payload, command.command);
  gf_put_u16(payload + 2, command.token);
  memcpy(payload + 4, command.arguments, command.size);
  return command.size + 4u;
}

static size_t pack_one(long type, size_t n, gf_batch_t *batch) {
  switch (type) {
    case GF_TYPE_HELLO:
      return pack_hello(batch->payload);
    case GF_TYPE_STATUS:
      return pack_status(batch->payload);
    case GF_TYPE_ACC12:
      return pack_acc12(batch, n);
    case GF_TYPE_ADC:
      return pack_adc(batch, n);
    case GF_TYPE_TACHO:
      return pack_tacho(batch, n);
    case GF_TYPE_PPS:
      return pack_pps(batch->payload);
    case GF_TYPE_GPS:
      return pack_gps(batch, n);
    case GF_TYPE_IMU6:
      return pack_imu6(batch, n);
    case GF_TYPE_CMD:
      return pack_cmd(batch->payload, n);
    case GF_TYPE_ACK:
      return pack_ack(batch->payload, n);
    default:
      fprintf(stderr, "no builder for type %ld\n", type);
      exit(2);
  }
}

static void pack_all(void) {
  static char line[1 << 15];
  while (fgets(line, sizeof line, stdin) != NULL) {
    gf_batch_t batch = {0};
    char *text = line;
    const long type = strtol(text, &text, 10);
    size_t n = 0;
    while (n < sizeof values / sizeof *values) {
      char *end;
      const long long value = strtoll(text, &end, 10);
      if (end == text) {
        break;
      }
      values[n++] = value;
      text = end;
    }
    at = 0;
    print_hex(batch.payload, pack_one(type, n, &batch));
  }
}

int main(int argc, char **argv) {
  if (argc == 2 && strcmp(argv[1], "decode") == 0) {
    decode_all();
  } else if (argc == 2 && strcmp(argv[1], "encode") == 0) {
    encode_all();
  } else if (argc == 2 && strcmp(argv[1], "pack") == 0) {
    pack_all();
  } else {
    fprintf(stderr, "gf_harness decode|encode|pack\n");
    return 2;
  }
  return 0;
}
