/*
 * libFuzzer: any bytes into the decoder.  Every byte is accounted for, sizes stay within the wire's, a frame that is encoded again gives
 * a frame that decodes to the same, and cutting the stream changes nothing (the decoder takes single bytes).
 */
#include <stdlib.h>
#include <string.h>

#include "gf_frame.h"

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size);

static void demand(int holds) {
  if (!holds) {
    abort();
  }
}

static void again(const gf_decoder_t *seen) {
  uint8_t wire[GF_MAX_WIRE];
  gf_decoder_t decoder = {0};
  gf_event_t event = GF_MORE;
  const size_t size = gf_encode(wire, sizeof wire, &seen->header, seen->payload, seen->payload_size);
  demand(size != 0u && size <= GF_MAX_WIRE);
  for (size_t i = 0; i < size; i++) {
    demand(event == GF_MORE);
    event = gf_push(&decoder, wire[i]);
  }
  demand(event == GF_FRAME && decoder.payload_size == seen->payload_size && decoder.wire_size == size);
  demand(decoder.header.seq == seen->header.seq && decoder.header.t_us == seen->header.t_us);
  demand(memcmp(decoder.payload, seen->payload, seen->payload_size) == 0);
}

int LLVMFuzzerTestOneInput(const uint8_t *data, size_t size) {
  gf_decoder_t decoder = {0};
  size_t accounted = 0;
  for (size_t i = 0; i < size; i++) {
    const gf_event_t event = gf_push(&decoder, data[i]);
    if (event != GF_MORE) {
      demand(decoder.wire_size != 0u && decoder.wire_size <= GF_MAX_WIRE);
      accounted += decoder.wire_size;
    }
    if (event == GF_FRAME) {
      again(&decoder);
    }
    demand(accounted + gf_pending(&decoder) == i + 1u);
    demand(gf_pending(&decoder) <= GF_MAX_BODY + 1u);
  }
  return 0;
}
