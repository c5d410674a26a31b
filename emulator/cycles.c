/* What an instruction costs, counted before each block of code runs.  See cycles.py for the costs.
 *
 * Unicorn calls gf_on_block for every block; `state` is the array that cycles.py names. */
#include <stddef.h>
#include <stdint.h>

enum { REFILL = 2 };                     /* clocks, after a taken branch */
static const uint32_t LINE = 0xFFFFFFF0; /* flash is read in lines of 16 bytes */

/* Shared with Python, by its names; all 64 bit. */
struct gf_clock {
  int64_t cycles, deadline, instructions, last_end;
  int64_t stop;    /* address of uc_emu_stop */
  int64_t stopped; /* 1 once it was called */
  int64_t code;    /* where the code lies in this process */
  int64_t code_size;
  int64_t flash_wait;
};

static int ones(uint32_t mask) {
  int n = 0;
  for (; mask; mask >>= 1) n += (int)(mask & 1u);
  return n;
}

/* Clocks of a 16-bit instruction, without the refill of a branch. */
int gf_narrow_cost(uint32_t op) {
  const uint32_t four = op >> 12;
  if (op >> 11 == 0x9u || four == 0x5u || op >> 13 == 0x3u || four == 0x8u || four == 0x9u) return 2;
  if ((op & 0xF600u) == 0xB400u) return 1 + ones(op & 0x1FFu); /* push, pop */
  if (four == 0xCu) return 1 + ones(op & 0xFFu);               /* stm, ldm */
  return 1;
}

/* Clocks of a 32-bit instruction, without the refill of a branch. */
int gf_wide_cost(uint32_t first, uint32_t second) {
  if ((first & 0xFE40u) == 0xE800u) return 1 + ones(second); /* stm, ldm */
  if ((first & 0xFE40u) == 0xE840u) return 3;                /* ldrd, strd, exclusive, tbb */
  if ((first & 0xFE00u) == 0xF800u) return 2;
  if ((first & 0xFFD0u) == 0xFB90u) return 8; /* sdiv, udiv */
  if ((first & 0xFF80u) == 0xFB80u) return 5; /* umull, smlal ... */
  return 1;
}

static uint32_t halfword(const uint8_t *code) { return (uint32_t)code[0] | (uint32_t)code[1] << 8; }

static void count_block(const uint8_t *code, int64_t size, int64_t *clocks, int64_t *count) {
  for (int64_t at = 0; at < size; ++*count) {
    const uint32_t first = halfword(code + at);
    if (first >> 11 >= 0x1Du && at + 2 < size) {
      *clocks += gf_wide_cost(first, halfword(code + at + 2));
      at += 4;
    } else {
      *clocks += gf_narrow_cost(first);
      at += 2;
    }
  }
}

/* Unicorn's UC_HOOK_BLOCK: stop at the deadline, else count the block. */
void gf_on_block(void *engine, uint64_t address, uint32_t size, struct gf_clock *state) {
  if (state->cycles >= state->deadline) {
    if (!state->stopped) {
      int (*stop)(void *) = (int (*)(void *))(uintptr_t)state->stop;
      state->stopped = 1;
      stop(engine);
    }
    return;
  }
  const int64_t at = (int64_t)address, end = at + (int64_t)size;
  int64_t clocks = 0, count = 0;
  if (end <= state->code_size) {
    count_block((const uint8_t *)(uintptr_t)state->code + at, size, &clocks, &count);
    if (at != state->last_end) {
      clocks += REFILL;
      if (((uint32_t)at & LINE) != ((uint32_t)state->last_end & LINE)) clocks += state->flash_wait;
    }
  } else {
    clocks = count = size >> 1;
  }
  state->last_end = end;
  state->cycles += clocks;
  state->instructions += count;
}
