#ifndef GF_FRAME_H
#define GF_FRAME_H

/*
 * The wire between board and gateway, device side.
 *
 *     00  COBS( header 16 | payload 0..488 | crc32 )  00      little-endian, at most 512 bytes
 *
 * C99.  No heap, no globals, no library calls: the caller owns all memory.  Constants, frame types and payload
 * offsets are in gf_spec.h, which is made from spec.toml.  Behaviour is that of codec.py, byte for byte.
 */

#include <stddef.h>
#include <stdint.h>

#include "gf_spec.h"

typedef struct {
  uint8_t type;  /* GF_TYPE_... */
  uint8_t epoch; /* boot counter */
  uint8_t flags; /* GF_FLAG_... */
  uint32_t seq;  /* frames built before this one, also those dropped */
  uint64_t t_us; /* device time of the first datum, microseconds since boot */
} gf_header_t;

typedef enum {
  GF_MORE,   /* nothing yet: push the next byte */
  GF_FRAME,  /* a whole frame: header, payload, payload_size and wire_size are set */
  GF_DAMAGED /* bytes that are no frame: reason and wire_size are set, the bytes themselves are gone */
} gf_event_t;

/* All zero is the start.  The wire_size of all events plus gf_pending() is the number of bytes pushed. */
typedef struct {
  uint8_t body[GF_MAX_BODY]; /* since the last delimiter */
  uint16_t size;             /* bytes in body */
  uint16_t zeros;            /* delimiters before it that no event carries yet */
  uint8_t overrun;           /* inside a chunk that is longer than any frame */
  /* the last event */
  gf_header_t header;
  const uint8_t *payload; /* points into body: valid until the next push */
  uint16_t payload_size;
  uint16_t wire_size; /* bytes this event accounts for, delimiters included */
  gf_reason_t reason;
} gf_decoder_t;

/* One byte from the line.  At most one event per byte. */
gf_event_t gf_push(gf_decoder_t *decoder, uint8_t byte);

/* Bytes pushed that no event carries yet, at most 511. */
size_t gf_pending(const gf_decoder_t *decoder);

/* Most bytes gf_encode() writes for a payload of this size. */
size_t gf_encoded_bound(size_t payload_size);

/*
 * Write one frame, both delimiters included, to wire[0 .. result).  Returns 0 and writes nothing when the payload
 * exceeds GF_MAX_PAYLOAD or capacity is below gf_encoded_bound(payload_size).  payload may be NULL when empty;
 * wire and payload must not overlap.
 */
size_t gf_encode(uint8_t *wire, size_t capacity, const gf_header_t *header, const uint8_t *payload,
                 size_t payload_size);

/* CRC-32/ISO-HDLC.  Start with crc 0; feed the result back to go on. */
uint32_t gf_crc32(uint32_t crc, const uint8_t *data, size_t size);

/* Little-endian access to payload fields at the offsets of gf_spec.h. */
void gf_put_u16(uint8_t *at, uint16_t value);
void gf_put_u32(uint8_t *at, uint32_t value);
void gf_put_u64(uint8_t *at, uint64_t value);
uint16_t gf_get_u16(const uint8_t *at);
uint32_t gf_get_u32(const uint8_t *at);
uint64_t gf_get_u64(const uint8_t *at);

#endif
