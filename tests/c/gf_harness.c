/*
 * Runs the C core over what a test sends on stdin, and prints what it made of it.
 *
 *   decode   u32 size, bytes; again ...      one line per event, then "P pending" for each stream
 *   encode   u8 type, epoch, flags, u32 seq, u64 t_us, u16 size, payload; again ...    one hex line per frame
 */
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

#include "gf_frame.h"

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

int main(int argc, char **argv) {
  if (argc == 2 && strcmp(argv[1], "decode") == 0) {
    decode_all();
  } else if (argc == 2 && strcmp(argv[1], "encode") == 0) {
    encode_all();
  } else {
    fprintf(stderr, "gf_harness decode|encode\n");
    return 2;
  }
  return 0;
}
