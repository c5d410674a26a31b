#include "gf_frame.h"

enum { GF_CRC_SIZE = 4, GF_MIN_FRAME = GF_HEADER_SIZE + GF_CRC_SIZE, GF_BLOCK = 254 };

void gf_put_u16(uint8_t *at, uint16_t value) {
  at[0] = (uint8_t)(value & 0xFFu);
  at[1] = (uint8_t)(value >> 8);
}

void gf_put_u32(uint8_t *at, uint32_t value) {
  gf_put_u16(at, (uint16_t)(value & 0xFFFFu));
  gf_put_u16(at + 2, (uint16_t)(value >> 16));
}

void gf_put_u64(uint8_t *at, uint64_t value) {
  gf_put_u32(at, (uint32_t)(value & 0xFFFFFFFFu));
  gf_put_u32(at + 4, (uint32_t)(value >> 32));
}

uint16_t gf_get_u16(const uint8_t *at) { return (uint16_t)(at[0] | (uint16_t)(at[1] << 8)); }

uint32_t gf_get_u32(const uint8_t *at) { return gf_get_u16(at) | ((uint32_t)gf_get_u16(at + 2) << 16); }

uint64_t gf_get_u64(const uint8_t *at) { return gf_get_u32(at) | ((uint64_t)gf_get_u32(at + 4) << 32); }

/* Half a byte at a time: 64 bytes of flash instead of 1024, and still two look-ups per byte. */
uint32_t gf_crc32(uint32_t crc, const uint8_t *data, size_t size) {
  static const uint32_t table[16] = {0x00000000u, 0x1DB71064u, 0x3B6E20C8u, 0x26D930ACu, 0x76DC4190u, 0x6B6B51F4u,
                                     0x4DB26158u, 0x5005713Cu, 0xEDB88320u, 0xF00F9344u, 0xD6D6A3E8u, 0xCB61B38Cu,
                                     0x9B64C2B0u, 0x86D3D2D4u, 0xA00AE278u, 0xBDBDF21Cu};
  crc = ~crc;
  for (size_t i = 0; i < size; i++) {
    crc ^= data[i];
    crc = (crc >> 4) ^ table[crc & 15u];
    crc = (crc >> 4) ^ table[crc & 15u];
  }
  return ~crc;
}

/* ---- encoder ---- */

/* COBS: each block is a code (its length + 1) and up to 254 bytes without zero; a zero follows every block but full
 * ones and the last. */
typedef struct {
  uint8_t *wire;
  size_t size; /* bytes written */
  size_t code; /* where the code of the open block goes */
} gf_stuffer_t;

static void open_block(gf_stuffer_t *s) {
  s->code = s->size;
  s->size++;
}

static void close_block(gf_stuffer_t *s) { s->wire[s->code] = (uint8_t)(s->size - s->code); }

static void stuff(gf_stuffer_t *s, const uint8_t *data, size_t size) {
  for (size_t i = 0; i < size; i++) {
    if (s->size - s->code > GF_BLOCK) { /* full, and known only now not to be the last */
      close_block(s);
      open_block(s);
    }
    if (data[i] == 0u) {
      close_block(s);
      open_block(s);
    } else {
      s->wire[s->size] = data[i];
      s->size++;
    }
  }
}

size_t gf_encoded_bound(size_t payload_size) {
  const size_t body = payload_size + GF_MIN_FRAME;
  return body + (body + GF_BLOCK - 1u) / GF_BLOCK + 2u;
}

size_t gf_encode(uint8_t *wire, size_t capacity, const gf_header_t *header, const uint8_t *payload,
                 size_t payload_size) {
  uint8_t head[GF_HEADER_SIZE];
  uint8_t tail[GF_CRC_SIZE];
  gf_stuffer_t s;

  if (payload_size > GF_MAX_PAYLOAD || capacity < gf_encoded_bound(payload_size)) {
    return 0;
  }
  head[GF_HEADER_PROTO] = GF_PROTO;
  head[GF_HEADER_TYPE] = header->type;
  head[GF_HEADER_EPOCH] = header->epoch;
  head[GF_HEADER_FLAGS] = header->flags;
  gf_put_u32(head + GF_HEADER_SEQ, header->seq);
  gf_put_u64(head + GF_HEADER_T_US, header->t_us);
  gf_put_u32(tail, gf_crc32(gf_crc32(0, head, sizeof head), payload, payload_size));

  s.wire = wire;
  s.size = 0;
  wire[s.size++] = 0;
  open_block(&s);
  stuff(&s, head, sizeof head);
  stuff(&s, payload, payload_size);
  stuff(&s, tail, sizeof tail);
  close_block(&s);
  wire[s.size++] = 0;
  return s.size;
}

/* ---- decoder ---- */

#define NOT_COBS ((size_t)-1)

/* In place; the result is never longer than the input.  NOT_COBS when a code points behind the end. */
static size_t unstuff(uint8_t *body, size_t size) {
  size_t from = 0;
  size_t to = 0;
  while (from < size) {
    const size_t code = body[from++];
    if (code - 1u > size - from) {
      return NOT_COBS;
    }
    for (size_t i = 1; i < code; i++) {
      body[to++] = body[from++];
    }
    if (code <= GF_BLOCK && from < size) {
      body[to++] = 0;
    }
  }
  return to;
}

static uint8_t bit_count(uint8_t mask) {
  uint8_t count = 0;
  for (uint32_t left = mask; left != 0u; left &= left - 1u) {
    count++;
  }
  return count;
}

/* 1 when the payload holds what its type demands; unknown types demand nothing. */
static int payload_is_whole(uint8_t type, const uint8_t *payload, size_t size) {
  switch (type) {
#define GF_FIXED(id, least) \
  case id:                  \
    return size >= (least);
#define GF_ROWS(id, least, count_at, width) \
  case id:                                  \
    return size >= (least) && size - (least) >= (size_t)payload[count_at] * (width);
#define GF_MASKED(id, least, count_at, width, mask_at) \
  case id:                                             \
    return size >= (least) && size - (least) >= (size_t)payload[count_at] * (width) * bit_count(payload[mask_at]);
    GF_LENGTH_RULES
#undef GF_FIXED
#undef GF_ROWS
#undef GF_MASKED
    default:
      return 1;
  }
}

static gf_event_t damaged(gf_decoder_t *d, gf_reason_t reason, size_t wire_size) {
  d->reason = reason;
  d->wire_size = (uint16_t)wire_size;
  return GF_DAMAGED;
}

/* A chunk between two delimiters. */
static gf_event_t decode(gf_decoder_t *d, size_t wire_size) {
  uint8_t *body = d->body;
  const size_t size = unstuff(body, d->size);
  size_t payload_size;

  if (size == NOT_COBS) {
    return damaged(d, GF_REASON_COBS, wire_size);
  }
  if (size > GF_MIN_FRAME + GF_MAX_PAYLOAD) {
    return damaged(d, GF_REASON_LONG, wire_size);
  }
  if (size < GF_MIN_FRAME) {
    return damaged(d, GF_REASON_SHORT, wire_size);
  }
  if (gf_crc32(0, body, size - GF_CRC_SIZE) != gf_get_u32(body + size - GF_CRC_SIZE)) {
    return damaged(d, GF_REASON_CRC, wire_size);
  }
  if (body[GF_HEADER_PROTO] != GF_PROTO) {
    return damaged(d, GF_REASON_VERSION, wire_size);
  }
  payload_size = size - GF_MIN_FRAME;
  if (!payload_is_whole(body[GF_HEADER_TYPE], body + GF_HEADER_SIZE, payload_size)) {
    return damaged(d, GF_REASON_PAYLOAD, wire_size);
  }
  d->header.type = body[GF_HEADER_TYPE];
  d->header.epoch = body[GF_HEADER_EPOCH];
  d->header.flags = body[GF_HEADER_FLAGS];
  d->header.seq = gf_get_u32(body + GF_HEADER_SEQ);
  d->header.t_us = gf_get_u64(body + GF_HEADER_T_US);
  d->payload = body + GF_HEADER_SIZE;
  d->payload_size = (uint16_t)payload_size;
  d->wire_size = (uint16_t)wire_size;
  return GF_FRAME;
}

/* A delimiter behind a delimiter opens a frame; more of them are idle line. */
static gf_event_t idle(gf_decoder_t *d) {
  const size_t spare = (size_t)d->zeros - 1u;
  d->zeros = 1;
  return damaged(d, GF_REASON_IDLE, spare);
}

static gf_event_t push_delimiter(gf_decoder_t *d) {
  const size_t wire_size = (size_t)d->zeros + d->size + 1u;
  gf_event_t event;

  if (d->size == 0u) {
    d->zeros++;
    return d->zeros > GF_MAX_BODY ? idle(d) : GF_MORE;
  }
  event = d->overrun ? damaged(d, GF_REASON_LONG, wire_size) : decode(d, wire_size);
  d->size = 0;
  d->zeros = 0;
  d->overrun = 0;
  return event;
}

gf_event_t gf_push(gf_decoder_t *d, uint8_t byte) {
  gf_event_t event = GF_MORE;

  if (byte == 0u) {
    return push_delimiter(d);
  }
  if (d->size == GF_MAX_BODY) { /* cut off what exceeds any frame; nothing of this chunk is a frame any more */
    event = damaged(d, GF_REASON_LONG, (size_t)d->zeros + d->size);
    d->size = 0;
    d->zeros = 0;
    d->overrun = 1;
  } else if (d->size == 0u && d->zeros > 1u) {
    event = idle(d);
  } else {
    /* one more byte of a chunk */
  }
  d->body[d->size++] = byte;
  return event;
}

size_t gf_pending(const gf_decoder_t *d) { return (size_t)d->zeros + d->size; }
