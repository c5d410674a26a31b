#ifndef GF_COMMAND_H
#define GF_COMMAND_H

/* What a host may ask and set: parsing, checking, defaults.  Doing it is the board's. */

#include "gf_frame.h"

enum { GF_FIRST_SETTING = GF_SET_RATE_HZ, GF_SETTINGS = GF_SET_GNSS_BAUD - GF_SET_RATE_HZ + 1 };

typedef struct {
  uint16_t command;
  uint16_t token;
  const uint8_t *arguments; /* points into the payload */
  uint16_t size;            /* of the arguments, bytes */
} gf_command_t;

typedef struct {
  uint32_t value[GF_SETTINGS]; /* by id - GF_FIRST_SETTING */
} gf_settings_t;

/* 1 and the command, or 0 when the payload is shorter than any CMD. */
int gf_command_parse(gf_command_t *command, const uint8_t *payload, size_t size);

/* 1 for the id of a setting. */
int gf_is_setting(uint16_t id);

void gf_settings_default(gf_settings_t *settings);

/* id is that of a setting. */
uint32_t gf_setting(const gf_settings_t *settings, uint16_t id);

/*
 * Ask (no arguments) or change one setting (one u32).  Nothing changes unless the result is GF_RESULT_OK.
 * tick_hz is the rate of the timer that makes the sampling instants.
 */
gf_result_t gf_settings_command(gf_settings_t *settings, const gf_command_t *command, uint32_t tick_hz);

/* Samples per frame in force, 1..19; CRC for HELLO. */
uint32_t gf_settings_batch(const gf_settings_t *settings);
uint16_t gf_settings_crc(const gf_settings_t *settings);

#endif
