#include "gf_sender.h"

void gf_sender_start(gf_sender_t *sender, void *context, int (*write)(void *, const uint8_t *, size_t), uint8_t epoch,
                     uint8_t flags) {
  sender->context = context;
  sender->write = write;
  sender->epoch = epoch;
  sender->flags = flags;
  sender->gap = 0;
  sender->built = 0;
  sender->sent = 0;
  sender->dropped = 0;
}

int gf_send(gf_sender_t *sender, uint8_t type, uint64_t t_us, const uint8_t *payload, size_t size) {
  const uint8_t gap = sender->gap ? GF_FLAG_DROPPED : 0u;
  const gf_header_t header = {type, sender->epoch, (uint8_t)(sender->flags | gap), sender->built, t_us};
  const size_t wire_size = gf_encode(sender->wire, sizeof sender->wire, &header, payload, size);
  const int taken = wire_size != 0u && sender->write(sender->context, sender->wire, wire_size) != 0;

  sender->built++;
  sender->sent += taken ? 1u : 0u;
  sender->dropped += taken ? 0u : 1u;
  sender->gap = (uint8_t)(taken ? 0 : 1);
  return taken;
}
