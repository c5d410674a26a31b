#include "gf_command.h"

#include "gf_payload.h"

enum { GF_MAX_RATE_HZ = 3200, GF_MAX_AUTO_BATCH = 16, GF_ADC_WIRED = 0x3F };

static const uint32_t second_ns = 1000000000u;

int gf_command_parse(gf_command_t *command, const uint8_t *payload, size_t size) {
  if (size < GF_CMD_SIZE || size > GF_MAX_PAYLOAD) {
    return 0;
  }
  command->command = gf_get_u16(payload + GF_CMD_COMMAND);
  command->token = gf_get_u16(payload + GF_CMD_TOKEN);
  command->arguments = payload + GF_CMD_SIZE;
  command->size = (uint16_t)(size - GF_CMD_SIZE);
  return 1;
}

int gf_is_setting(uint16_t id) { return id >= GF_FIRST_SETTING && id < GF_FIRST_SETTING + GF_SETTINGS; }

void gf_settings_default(gf_settings_t *settings) {
  static const uint32_t defaults[GF_SETTINGS] = {GF_DEFAULT_RATE_HZ, GF_DEFAULT_BATCH, GF_DEFAULT_RANGE_G,
                                                 GF_DEFAULT_FIFO,    GF_DEFAULT_ADC_MASK, GF_DEFAULT_BAUD,
                                                 GF_DEFAULT_GNSS_BAUD};
  for (size_t i = 0; i < GF_SETTINGS; i++) {
    settings->value[i] = defaults[i];
  }
}

uint32_t gf_setting(const gf_settings_t *settings, uint16_t id) { return settings->value[id - GF_FIRST_SETTING]; }

static int is_between(uint32_t value, uint32_t least, uint32_t most) { return value >= least && value <= most; }

static int is_allowed(uint16_t id, uint32_t value, uint32_t tick_hz) {
  switch (id) {
    case GF_SET_RATE_HZ: /* whole nanoseconds and whole ticks, so that the grid never drifts */
      return is_between(value, 1, GF_MAX_RATE_HZ) && second_ns % value == 0u && tick_hz % value == 0u;
    case GF_SET_BATCH:
      return value <= GF_ACC12_MAX_ROWS;
    case GF_SET_RANGE_G:
      return value == 2u || value == 4u || value == 8u || value == 16u;
    case GF_SET_FIFO:
      return value <= 1u;
    case GF_SET_ADC_MASK:
      return value <= GF_ADC_WIRED;
    case GF_SET_BAUD:
      return is_between(value, 9600, 3000000);
    case GF_SET_GNSS_BAUD:
      return is_between(value, 4800, 921600);
    default:
      return 0;
  }
}

gf_result_t gf_settings_command(gf_settings_t *settings, const gf_command_t *command, uint32_t tick_hz) {
  uint32_t value;
  if (!gf_is_setting(command->command)) {
    return GF_RESULT_UNKNOWN;
  }
  if (command->size == 0u) {
    return GF_RESULT_OK;
  }
  if (command->size != 4u) {
    return GF_RESULT_LENGTH;
  }
  value = gf_get_u32(command->arguments);
  if (!is_allowed(command->command, value, tick_hz)) {
    return GF_RESULT_VALUE;
  }
  settings->value[command->command - GF_FIRST_SETTING] = value;
  return GF_RESULT_OK;
}

uint32_t gf_settings_batch(const gf_settings_t *settings) {
  const uint32_t batch = gf_setting(settings, GF_SET_BATCH);
  const uint32_t automatic = gf_setting(settings, GF_SET_RATE_HZ) / 125u;
  if (batch != 0u) {
    return batch;
  }
  if (automatic == 0u) {
    return 1;
  }
  return automatic < GF_MAX_AUTO_BATCH ? automatic : GF_MAX_AUTO_BATCH;
}

uint16_t gf_settings_crc(const gf_settings_t *settings) {
  uint8_t bytes[4];
  uint32_t crc = 0;
  for (size_t i = 0; i < GF_SETTINGS; i++) {
    gf_put_u32(bytes, settings->value[i]);
    crc = gf_crc32(crc, bytes, sizeof bytes);
  }
  return (uint16_t)(crc & 0xFFFFu);
}
