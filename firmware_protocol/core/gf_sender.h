#ifndef GF_SENDER_H
#define GF_SENDER_H

/* Numbers frames and hands them to a line that may be full: what it refuses is counted and said in the next frame. */

#include "gf_frame.h"

typedef struct {
  void *context;
  int (*write)(void *context, const uint8_t *wire, size_t size); /* all and 1, or nothing and 0 */
  uint8_t epoch;
  uint8_t flags; /* GF_FLAG_... of every frame; GF_FLAG_DROPPED is put in here */
  uint8_t gap;   /* the frame before was dropped */
  uint32_t built;
  uint32_t sent;
  uint32_t dropped;
  uint8_t wire[GF_MAX_WIRE];
} gf_sender_t;

/* All counters zero, this line, this boot. */
void gf_sender_start(gf_sender_t *sender, void *context, int (*write)(void *, const uint8_t *, size_t), uint8_t epoch,
                     uint8_t flags);

/* Build one frame and send it.  1 when the line took it.  size is at most GF_MAX_PAYLOAD. */
int gf_send(gf_sender_t *sender, uint8_t type, uint64_t t_us, const uint8_t *payload, size_t size);

#endif
