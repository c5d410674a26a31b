/* Clocks, power, pins, watchdog, identity. */

#include "port.h"

enum {
  FLASH_5_CLOCKS = 0x403A,
  OSCILLATOR_ON = 1 << 5,
  OSCILLATOR_READY = 1 << 6,
  PLL_ENABLE = 1,
  PLL_CONNECT = 2,
  PLL_ON = 3 << 24, /* enabled and connected */
  PLL_LOCKED = 1 << 26,
  PLL_X24 = 11,   /* M - 1, N = 1: 2 * 12 * 12 MHz = 288 MHz */
  CPU_DIVIDE_3 = 2
};

enum { /* PCONP */
  POWER_UART0 = 1 << 3,
  POWER_RTC = 1 << 9,
  POWER_SSP1 = 1 << 10,
  POWER_ADC = 1 << 12,
  POWER_GPIO = 1 << 15,
  POWER_SSP0 = 1 << 21,
  POWER_TIMER2 = 1 << 22,
  POWER_UART2 = 1 << 24
};

enum { WATCHDOG_RESETS = 3, WATCHDOG_1_S = 1000000 /* 4 MHz / 4 */, FEED_1 = 0xAA, FEED_2 = 0x55 };

enum { STRAP_SIMULATED = 1 << 0, LED_ALIVE = 1 << 18, LED_FAULT = 1 << 20, SETTLE_LOOPS = 1000 };

static int simulated;

static void pll_feed(void) {
  LPC_SYSCON->PLL0FEED = 0xAA;
  LPC_SYSCON->PLL0FEED = 0x55;
}

static void wait_for_bits(reg_read_t *reg, uint32_t bits) {
  while ((*reg & bits) != bits) {
  }
}

/* User manual, 4.6.  A reset leaves the core on its 4 MHz RC oscillator; a jump from a boot loader may not. */
static void start_clocks(void) {
  if ((LPC_SYSCON->PLL0STAT & PLL_ON) != 0u) {
    LPC_SYSCON->PLL0CON = PLL_ENABLE; /* disconnect, then switch off */
    pll_feed();
    LPC_SYSCON->PLL0CON = 0;
    pll_feed();
  }
  LPC_SYSCON->FLASHCFG = FLASH_5_CLOCKS;
  LPC_SYSCON->SCS = OSCILLATOR_ON;
  wait_for_bits((reg_read_t *)&LPC_SYSCON->SCS, OSCILLATOR_READY);
  /* before the PLL, errata PCLKSELx.1: CCLK for UART0 (7:6), SSP1 (21:20); CCLK / 8 for the ADC (25:24) */
  LPC_SYSCON->PCLKSEL0 = (1u << 6) | (1u << 20) | (3u << 24);
  /* CCLK for SSP0 (11:10), TIMER2 (13:12), UART2 (17:16) */
  LPC_SYSCON->PCLKSEL1 = (1u << 10) | (1u << 12) | (1u << 16);
  LPC_SYSCON->CCLKCFG = CPU_DIVIDE_3;
  LPC_SYSCON->CLKSRCSEL = 1;
  LPC_SYSCON->PLL0CFG = PLL_X24;
  pll_feed();
  LPC_SYSCON->PLL0CON = PLL_ENABLE;
  pll_feed();
  wait_for_bits(&LPC_SYSCON->PLL0STAT, PLL_LOCKED);
  LPC_SYSCON->PLL0CON = PLL_ENABLE | PLL_CONNECT;
  pll_feed();
  wait_for_bits(&LPC_SYSCON->PLL0STAT, PLL_ON);
}

/* Two bits of PINSEL per pin. */
static uint32_t function(uint32_t pin, uint32_t what) { return what << (2u * (pin % 16u)); }

static void start_pins(void) {
  LPC_PINCON->PINSEL0 = function(2, 1) | function(3, 1)                       /* UART0 */
                        | function(4, 3) | function(5, 3)                     /* CAP2.0, CAP2.1 */
                        | function(7, 2) | function(8, 2) | function(9, 2)    /* SSP1 */
                        | function(10, 1) | function(11, 1)                   /* UART2 */
                        | function(15, 2);                                    /* SCK0 */
  LPC_PINCON->PINSEL1 = function(17, 2) | function(18, 2)                     /* MISO0, MOSI0 */
                        | function(23, 1) | function(24, 1) | function(25, 1) | function(26, 1); /* AD0.0 .. AD0.3 */
  LPC_PINCON->PINSEL3 = function(30, 3) | function(31, 3);                    /* AD0.4, AD0.5 */
  LPC_PINCON->PINSEL4 = 0;
  /* no pull-up on analogue inputs; all other inputs keep theirs */
  LPC_PINCON->PINMODE1 = function(23, 2) | function(24, 2) | function(25, 2) | function(26, 2);
  LPC_PINCON->PINMODE3 = function(30, 2) | function(31, 2);
  LPC_GPIO1->DIR |= LED_ALIVE | LED_FAULT;
}

void system_start(void) {
  start_clocks();
  LPC_SYSCON->PCONP = POWER_UART0 | POWER_RTC | POWER_SSP1 | POWER_ADC | POWER_GPIO | POWER_SSP0 | POWER_TIMER2 | POWER_UART2;
  start_pins();
  for (volatile uint32_t i = 0; i < SETTLE_LOOPS; i++) { /* the pull-ups charge the straps */
  }
  simulated = (LPC_GPIO2->PIN & STRAP_SIMULATED) == 0u;
}

int system_is_simulated(void) { return simulated; }

void system_leds(int alive, int fault) {
  static uint32_t shown = UINT32_MAX;
  const uint32_t lit = (alive ? (uint32_t)LED_ALIVE : 0u) | (fault ? (uint32_t)LED_FAULT : 0u);
  if (lit != shown) {
    LPC_GPIO1->SET = lit;
    LPC_GPIO1->CLR = ~lit & ((uint32_t)LED_ALIVE | (uint32_t)LED_FAULT);
    shown = lit;
  }
}

void port_reset(void) {
  irq_off();
  SCB_AIRCR = 0x05FA0004u; /* SYSRESETREQ */
  for (;;) {
  }
}

void watchdog_start(void) {
  LPC_WDT->CLKSEL = 0; /* the internal RC oscillator */
  LPC_WDT->TC = WATCHDOG_1_S;
  LPC_WDT->MOD = WATCHDOG_RESETS;
  watchdog_feed();
}

void watchdog_feed(void) {
  const uint32_t primask = irq_save(); /* nothing may come between the two */
  LPC_WDT->FEED = FEED_1;
  LPC_WDT->FEED = FEED_2;
  irq_restore(primask);
}

/* The clock's registers outlive a reset; with a battery at VBAT also a loss of power. */
uint8_t system_next_epoch(void) {
  const uint32_t boots = LPC_RTC->GPREG[0];
  const uint32_t next = LPC_RTC->GPREG[1] == ~boots ? boots + 1u : 0u;
  LPC_RTC->GPREG[0] = next;
  LPC_RTC->GPREG[1] = ~next;
  return (uint8_t)(next & 0xFFu);
}

typedef void (*iap_t)(const uint32_t *command, uint32_t *result);

void system_uid(uint8_t uid[16]) {
  const iap_t iap = (iap_t)(uintptr_t)0x1FFF1FF1u;
  const uint32_t command[5] = {58, 0, 0, 0, 0}; /* read the serial number */
  uint32_t result[5] = {1, 0, 0, 0, 0};
  iap(command, result);
  for (uint32_t i = 0; i < 16u; i++) {
    uid[i] = result[0] == 0u ? (uint8_t)(result[1u + i / 4u] >> (8u * (i % 4u))) : 0u;
  }
}
