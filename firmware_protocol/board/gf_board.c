#include "gf_board.h"

enum { HELLO_EVERY_S = 10, STATUS_EVERY_S = 1, TEST_RATE_HZ = 100, TESTING = 1, TESTED = 2 };

static uint64_t now(const gf_board_t *b) { return b->port.now(b->port.context); }

static uint64_t to_us(const gf_board_t *b, uint64_t ticks) { return gf_ticks_to_us(ticks, b->port.tick_hz); }

static uint32_t setting(const gf_board_t *b, uint16_t id) { return gf_setting(&b->settings, id); }

/* ---- the tick ---- */

static void take_sample(gf_board_t *b, uint64_t ticks) {
  const uint8_t stale = gf_adxl345_read(&b->sensors);
  const uint32_t put = b->put;
  gf_sample_t *sample = &b->ring[put % (uint32_t)GF_BOARD_SAMPLES];

  b->samples++;
  if (b->analog.mask != 0u) {
    (void)gf_analog_read(&b->analog);
  }
  if (put - b->taken >= (uint32_t)GF_BOARD_SAMPLES) {
    b->drops++;
    return;
  }
  sample->ticks = ticks;
  sample->index = b->instants;
  sample->alive = b->sensors.alive;
  sample->stale = stale;
  for (uint32_t i = 0; i < GF_AXES; i++) {
    sample->counts[i] = b->sensors.counts[i];
  }
  if (b->analog.mask != 0u) {
    for (uint32_t i = 0; i < GF_ADC_CHANNELS; i++) {
      sample->analog[i] = b->analog.counts[i];
    }
  }
  b->put = put + 1u;
}

void gf_board_tick(gf_board_t *b, uint64_t ticks, uint32_t missed) {
  if (b->testing == TESTING) {
    if (gf_adxl345_test_step(&b->sensors, &b->test)) {
      b->testing = TESTED;
    }
    return;
  }
  if (!b->running) {
    return;
  }
  b->missed += missed;
  b->instants += missed;
  take_sample(b, ticks);
  b->instants++;
  if (b->until_try != 0u) {
    b->until_try--;
  } else {
    b->until_try = b->rate_hz;
    (void)gf_adxl345_start_missing(&b->sensors);
  }
}

/* ---- frames ---- */

static int send_frame(gf_board_t *b, uint8_t type, uint64_t t_us, const uint8_t *payload, size_t size) {
  return gf_send(&b->sender, type, t_us, payload, size);
}

static void send_hello(gf_board_t *b) {
  uint8_t payload[GF_HELLO_SIZE];
  gf_hello_t hello = {0};
  hello.board_id = b->port.simulated ? GF_BOARD_EMULATED : GF_BOARD_LPC1768;
  hello.sensor_mask = b->sensors.alive;
  hello.n_axes = GF_AXES;
  hello.tick_hz = b->port.tick_hz;
  hello.sample_period_ns = b->period_ns;
  hello.batch = b->batch;
  for (uint32_t i = 0; i < sizeof hello.uid; i++) {
    hello.uid[i] = b->port.uid[i];
  }
  for (uint32_t i = 0; i < sizeof hello.firmware; i++) {
    hello.firmware[i] = b->port.firmware[i];
  }
  hello.version[0] = GF_VERSION_MAJOR;
  hello.version[1] = GF_VERSION_MINOR;
  hello.version[2] = GF_VERSION_PATCH;
  hello.config_crc = gf_settings_crc(&b->settings);
  for (uint32_t i = 0; i < GF_SENSORS; i++) {
    hello.sensors[i].model = 1;
    hello.sensors[i].bus = b->port.bus_of[i];
    hello.sensors[i].range_code = gf_adxl345_range_code(setting(b, GF_SET_RANGE_G));
    hello.sensors[i].rate_code = b->sensors.rate_code;
    hello.sensors[i].scale_ng = GF_ADXL345_SCALE_NG;
  }
  (void)send_frame(b, GF_TYPE_HELLO, to_us(b, now(b)), payload, gf_pack_hello(payload, &hello));
  b->sender.flags = (uint8_t)(b->sender.flags & ~(uint32_t)GF_FLAG_CONFIG);
}

static void measure_load(gf_board_t *b, uint64_t at) {
  const uint64_t idle = b->port.idle_ticks(b->port.context);
  const uint64_t span = at - b->load_at;
  if (span != 0u) {
    const uint64_t slept = idle - b->load_from;
    b->permille = slept < span ? (uint32_t)((span - slept) * 1000u / span) : 0u;
  }
  b->load_from = idle;
  b->load_at = at;
}

static void send_status(gf_board_t *b) {
  uint8_t payload[GF_STATUS_SIZE];
  gf_status_t status;
  const uint64_t at = now(b);
  measure_load(b, at);
  status.built = b->sender.built;
  status.sent = b->sender.sent;
  status.dropped = b->sender.dropped;
  status.samples = b->samples;
  status.missed_ticks = b->missed;
  status.sample_drops = b->drops;
  for (uint32_t i = 0; i < GF_SENSORS; i++) {
    status.spi_errors[i] = b->sensors.spi_errors[i];
    status.init_errors[i] = b->sensors.init_errors[i];
    status.fifo_overruns[i] = b->sensors.overruns[i];
  }
  status.tacho_total = b->tacho.total;
  status.tacho_overflow = b->port.tacho.overflows(b->port.tacho.context);
  status.pps_total = b->pps.total;
  status.gps_bytes = b->gnss.total;
  status.rx_ok = b->rx_ok;
  status.rx_bad = b->rx_bad;
  status.uart_errors = b->port.host.errors(b->port.host.context) + b->port.gnss.errors(b->port.gnss.context);
  status.free_stack = b->port.free_stack(b->port.context);
  status.cpu_permille = b->permille;
  status.last_seq = b->sender.built - 1u;
  (void)send_frame(b, GF_TYPE_STATUS, to_us(b, at), payload, gf_pack_status(payload, &status));
}

static void flush(gf_board_t *b) {
  if (b->acc.n != 0u) {
    (void)send_frame(b, GF_TYPE_ACC12, b->acc.t_us, b->acc.payload, b->acc.size);
    b->acc.n = 0;
  }
  if (b->adc.n != 0u) {
    (void)send_frame(b, GF_TYPE_ADC, b->adc.t_us, b->adc.payload, b->adc.size);
    b->adc.n = 0;
  }
}

static void frame_sample(gf_board_t *b, const gf_sample_t *sample) {
  /* the rows of a frame lie on one grid and have one set of sensors */
  if (sample->index != b->next_index || sample->alive != b->acc_alive) {
    flush(b);
  }
  if (b->acc.n == 0u) {
    gf_acc12_begin(&b->acc, to_us(b, sample->ticks), sample->index, b->period_ns, sample->alive);
    b->acc_alive = sample->alive;
  }
  (void)gf_acc12_row(&b->acc, sample->counts, sample->stale);
  if (b->adc_mask != 0u) {
    if (b->adc.n == 0u) {
      gf_adc_begin(&b->adc, to_us(b, sample->ticks), sample->index, b->period_ns, b->adc_mask, GF_ANALOG_VREF_MV);
    }
    (void)gf_adc_row(&b->adc, sample->analog);
  }
  b->next_index = sample->index + 1u;
  if (b->acc.n >= b->batch) {
    flush(b);
  }
}

static void frame_samples(gf_board_t *b) {
  while (b->taken != b->put) {
    const uint32_t taken = b->taken;
    const gf_sample_t sample = b->ring[taken % (uint32_t)GF_BOARD_SAMPLES];
    b->taken = taken + 1u;
    frame_sample(b, &sample);
  }
}

/* ---- starting, stopping, settings ---- */

static void set_period(gf_board_t *b, uint32_t rate_hz) {
  b->rate_hz = rate_hz;
  b->period_ns = 1000000000u / rate_hz;
  b->port.set_period(b->port.context, b->port.tick_hz / rate_hz);
}

/* Give the settings to sensors and converter.  The tick is off. */
static void configure(gf_board_t *b) {
  const uint32_t rate_hz = setting(b, GF_SET_RATE_HZ);
  b->batch = gf_settings_batch(&b->settings);
  b->adc_mask = (uint8_t)setting(b, GF_SET_ADC_MASK);
  gf_analog_start(&b->analog, b->adc_mask);
  (void)gf_adxl345_start(&b->sensors, rate_hz, setting(b, GF_SET_RANGE_G), setting(b, GF_SET_FIFO) != 0u);
  b->until_try = rate_hz;
  set_period(b, rate_hz);
}

/* No tick from here on; everything sampled is sent. */
static void halt(gf_board_t *b) {
  b->port.set_period(b->port.context, 0);
  frame_samples(b);
  flush(b);
}

/* ---- commands ---- */

static void acknowledge(gf_board_t *b, const gf_command_t *command, gf_result_t result, const uint8_t *echo,
                        size_t size) {
  uint8_t payload[GF_ACK_SIZE + GF_ACK_MAX_ECHO];
  const size_t length = gf_pack_ack(payload, command->command, command->token, (int16_t)result, echo, size);
  (void)send_frame(b, GF_TYPE_ACK, to_us(b, now(b)), payload, length);
}

/* The line that a setting is about, or NULL. */
static const gf_line_t *line_of(const gf_board_t *b, uint16_t id) {
  if (id == GF_SET_BAUD) {
    return &b->port.host;
  }
  return id == GF_SET_GNSS_BAUD ? &b->port.gnss : NULL;
}

static gf_result_t change(gf_board_t *b, const gf_command_t *command, const gf_line_t *line) {
  gf_settings_t wanted = b->settings;
  const gf_result_t result = gf_settings_command(&wanted, command, b->port.tick_hz);
  if (b->testing) {
    return GF_RESULT_BUSY;
  }
  if (result == GF_RESULT_OK && line != NULL && !line->can_baud(line->context, gf_setting(&wanted, command->command))) {
    return GF_RESULT_VALUE;
  }
  b->settings = wanted; /* as it was unless the result is OK */
  return result;
}

static void do_setting(gf_board_t *b, const gf_command_t *command) {
  const gf_line_t *line = line_of(b, command->command);
  const gf_result_t result = change(b, command, line);
  const int changed = result == GF_RESULT_OK && command->size != 0u;
  uint8_t echo[4];

  if (changed) {
    b->sender.flags = (uint8_t)(b->sender.flags | (uint32_t)GF_FLAG_CONFIG);
    if (line == NULL) {
      halt(b);
      configure(b);
    }
  }
  gf_put_u32(echo, setting(b, command->command));
  acknowledge(b, command, result, echo, sizeof echo);
  if (changed) {
    send_hello(b);
    if (line != NULL) {
      line->set_baud(line->context, setting(b, command->command));
    }
  }
}

static void begin_test(gf_board_t *b, const gf_command_t *command) {
  if (b->running || b->testing) {
    acknowledge(b, command, GF_RESULT_BUSY, NULL, 0);
    return;
  }
  b->port.set_period(b->port.context, 0);
  gf_adxl345_test_start(&b->sensors, &b->test);
  if (b->test.tested == 0u) {
    acknowledge(b, command, GF_RESULT_DEVICE, NULL, 0);
    configure(b);
    return;
  }
  b->asked = *command;
  b->testing = TESTING;
  set_period(b, TEST_RATE_HZ);
}

static void end_test(gf_board_t *b) {
  uint8_t echo[2 + 2 * GF_AXES];
  halt(b);
  echo[0] = b->test.passed;
  echo[1] = b->test.tested;
  for (size_t i = 0; i < GF_AXES; i++) {
    gf_put_u16(echo + 2u + 2u * i, (uint16_t)b->test.change[i]);
  }
  b->testing = 0;
  configure(b);
  acknowledge(b, &b->asked, GF_RESULT_OK, echo, sizeof echo);
}

static void tell_time(gf_board_t *b, const gf_command_t *command, uint64_t read_at) {
  uint8_t echo[16];
  gf_put_u64(echo, to_us(b, read_at));
  gf_put_u64(echo + 8, to_us(b, now(b)));
  acknowledge(b, command, GF_RESULT_OK, echo, sizeof echo);
}

static void do_action(gf_board_t *b, const gf_command_t *command, uint64_t read_at) {
  if (command->size != 0u) {
    acknowledge(b, command, GF_RESULT_LENGTH, NULL, 0);
    return;
  }
  switch (command->command) {
    case GF_DO_HELLO:
      acknowledge(b, command, GF_RESULT_OK, NULL, 0);
      send_hello(b);
      break;
    case GF_DO_STATUS:
      acknowledge(b, command, GF_RESULT_OK, NULL, 0);
      send_status(b);
      break;
    case GF_DO_START:
      if (b->testing) {
        acknowledge(b, command, GF_RESULT_BUSY, NULL, 0);
      } else {
        b->running = 1;
        acknowledge(b, command, GF_RESULT_OK, NULL, 0);
      }
      break;
    case GF_DO_STOP:
      b->running = 0;
      frame_samples(b);
      flush(b);
      acknowledge(b, command, GF_RESULT_OK, NULL, 0);
      send_status(b);
      break;
    case GF_DO_TIME:
      tell_time(b, command, read_at);
      break;
    case GF_DO_SELF_TEST:
      begin_test(b, command);
      break;
    case GF_DO_REBOOT:
      acknowledge(b, command, GF_RESULT_OK, NULL, 0);
      b->port.reboot(b->port.context);
      break;
    default:
      acknowledge(b, command, GF_RESULT_UNKNOWN, NULL, 0);
      break;
  }
}

static void obey(gf_board_t *b, uint64_t read_at) {
  gf_command_t command;
  b->rx_ok++;
  if (b->decoder.header.type != GF_TYPE_CMD ||
      !gf_command_parse(&command, b->decoder.payload, b->decoder.payload_size)) {
    return; /* a good frame that asks nothing of a board */
  }
  if (gf_is_setting(command.command)) {
    do_setting(b, &command);
  } else {
    do_action(b, &command, read_at);
  }
}

static void listen(gf_board_t *b) {
  uint8_t bytes[32];
  size_t n = b->port.host.read(b->port.host.context, bytes, sizeof bytes);
  while (n != 0u) {
    const uint64_t read_at = now(b);
    for (size_t i = 0; i < n; i++) {
      switch (gf_push(&b->decoder, bytes[i])) {
        case GF_FRAME:
          obey(b, read_at);
          break;
        case GF_DAMAGED:
          b->rx_bad++;
          break;
        case GF_MORE:
        default:
          break;
      }
    }
    n = b->port.host.read(b->port.host.context, bytes, sizeof bytes);
  }
}

/* ---- the main loop ---- */

static void forward(gf_board_t *b, uint64_t at) {
  while (gf_tacho_poll(&b->tacho, at)) {
    (void)send_frame(b, GF_TYPE_TACHO, b->tacho.frame.t_us, b->tacho.frame.payload, b->tacho.frame.size);
  }
  while (gf_pps_poll(&b->pps)) {
    (void)send_frame(b, GF_TYPE_PPS, b->pps.t_us, b->pps.payload, sizeof b->pps.payload);
  }
  while (gf_gnss_poll(&b->gnss, at)) {
    (void)send_frame(b, GF_TYPE_GPS, b->gnss.frame.t_us, b->gnss.frame.payload, b->gnss.frame.size);
  }
}

void gf_board_start(gf_board_t *b) {
  const uint8_t flags = b->port.simulated ? GF_FLAG_SIMULATED : 0u;
  const uint64_t at = now(b);
  gf_settings_default(&b->settings);
  gf_sender_start(&b->sender, b->port.host.context, b->port.host.write, b->port.epoch, flags);
  b->sensors.spi = &b->port.spi;
  b->analog.adc = &b->port.adc;
  gf_tacho_start(&b->tacho, &b->port.tacho, b->port.tick_hz);
  gf_pps_start(&b->pps, &b->port.pps, b->port.tick_hz);
  gf_gnss_start(&b->gnss, &b->port.gnss, b->port.tick_hz);
  b->load_at = at;
  b->next_status = at + (uint64_t)b->port.tick_hz * STATUS_EVERY_S;
  b->next_hello = at + (uint64_t)b->port.tick_hz * HELLO_EVERY_S;
  b->running = 1;
  configure(b);
  send_hello(b);
}

void gf_board_step(gf_board_t *b) {
  uint64_t at;
  listen(b);
  frame_samples(b);
  at = now(b);
  forward(b, at);
  if (b->testing == TESTED) {
    end_test(b);
  }
  if (at >= b->next_status) {
    b->next_status += (uint64_t)b->port.tick_hz * STATUS_EVERY_S;
    send_status(b);
  }
  if (at >= b->next_hello) {
    b->next_hello += (uint64_t)b->port.tick_hz * HELLO_EVERY_S;
    send_hello(b);
  }
}
