/* SSP0 with sensors 0 and 1, SSP1 with sensors 2 and 3: both buses work at once. */

#include "port.h"

enum {
  SIXTEEN_BITS = 15,
  MODE_3 = 3 << 6,
  DIVIDE_10 = 9 << 8, /* with CPSR 2: 4.8 MHz, the sensor takes 5 */
  ENABLE = 1 << 1,
  NOT_EMPTY = 1 << 2,
  BUSY = 1 << 4,
  PATIENCE = 10000, /* polls; eight words take about 600 */
  PAUSE = CORE_HZ / 1000000 * 5
};

typedef struct {
  lpc_gpio_t *port;
  uint32_t pin;
} select_t;

static const select_t selects[GF_SPI_DEVICES] = {
    {LPC_GPIO0, 1u << 16}, {LPC_GPIO2, 1u << 5}, {LPC_GPIO0, 1u << 6}, {LPC_GPIO2, 1u << 4}};

static void start_bus(lpc_ssp_t *bus) {
  bus->CR1 = 0;
  bus->CR0 = SIXTEEN_BITS | MODE_3 | DIVIDE_10;
  bus->CPSR = 2;
  bus->CR1 = ENABLE;
  while ((bus->SR & NOT_EMPTY) != 0u) {
    (void)bus->DR;
  }
}

void spi_start(void) {
  for (uint32_t i = 0; i < GF_SPI_DEVICES; i++) {
    selects[i].port->SET = selects[i].pin;
    selects[i].port->DIR |= selects[i].pin;
  }
  start_bus(LPC_SSP0);
  start_bus(LPC_SSP1);
}

static void send(uint32_t device, lpc_ssp_t *bus, const uint16_t *out, uint8_t n) {
  selects[device].port->CLR = selects[device].pin;
  for (uint32_t i = 0; i < n; i++) { /* n is at most the depth of the FIFO */
    bus->DR = out[i];
  }
}

static int receive(uint32_t device, lpc_ssp_t *bus, uint16_t *in, uint8_t n) {
  uint32_t patience = PATIENCE;
  while ((bus->SR & BUSY) != 0u && patience != 0u) {
    patience--;
  }
  selects[device].port->SET = selects[device].pin;
  if (patience == 0u) {
    start_bus(bus);
    return 0;
  }
  for (uint32_t i = 0; i < n; i++) {
    in[i] = (uint16_t)bus->DR;
  }
  return 1;
}

uint8_t spi_exchange(void *context, uint8_t device_mask, const uint16_t *out, uint16_t in[][GF_SPI_WORDS], uint8_t n) {
  uint32_t done = 0;
  (void)context;
  for (uint32_t low = 0; low < 2u; low++) {
    const uint32_t high = low + 2u;
    const uint32_t mask = device_mask & ((1u << low) | (1u << high));
    if ((mask & (1u << low)) != 0u) {
      send(low, LPC_SSP0, out, n);
    }
    if ((mask & (1u << high)) != 0u) {
      send(high, LPC_SSP1, out, n);
    }
    if ((mask & (1u << low)) != 0u && receive(low, LPC_SSP0, in[low], n)) {
      done |= 1u << low;
    }
    if ((mask & (1u << high)) != 0u && receive(high, LPC_SSP1, in[high], n)) {
      done |= 1u << high;
    }
  }
  return (uint8_t)done;
}

void spi_pause(void *context) {
  const uint32_t from = LPC_TIMER2->TC;
  (void)context;
  while (LPC_TIMER2->TC - from < PAUSE) {
  }
}
