/* Burst mode: the converter goes round the channels on its own, 33 us for six; a sample takes what is newest. */

#include "port.h"

enum { BURST = 1 << 16, POWERED = 1 << 21 };

static uint32_t channels; /* that the converter goes round */

/* 12 MHz from PCLK = CCLK / 8, divisor 1; 65 clocks a conversion. */
uint8_t adc_read(void *context, uint8_t channel_mask, uint16_t *values) {
  uint32_t fresh = 0;
  (void)context;
  if (channel_mask != channels) {
    channels = channel_mask;
    LPC_ADC->INTEN = 0;
    LPC_ADC->CR = POWERED;
    if (channels != 0u) {
      LPC_ADC->CR = channels | POWERED | BURST;
    }
    return 0;
  }
  for (uint32_t i = 0; i < 8u; i++) {
    if (((channels >> i) & 1u) != 0u) {
      const uint32_t result = LPC_ADC->DR[i]; /* reading clears bit 31, done */
      values[i] = (uint16_t)((result >> 4) & 0xFFFu);
      fresh |= (result >> 31) << i;
    }
  }
  return (uint8_t)fresh;
}
