#ifndef LPC1768_H
#define LPC1768_H

/*
 * Registers of the LPC1768 that this port uses.  Offsets are checked against the vendor's SVD by tests/test_firmware_registers.py.
 * Members are named as there; gaps are named gap_<offset>.
 */

#include <stdint.h>

typedef volatile uint32_t reg_t;
typedef volatile const uint32_t reg_read_t;

typedef struct {
  reg_t FLASHCFG;          /* 000 */
  uint32_t gap_004[31];
  reg_t PLL0CON;           /* 080 */
  reg_t PLL0CFG;           /* 084 */
  reg_read_t PLL0STAT;     /* 088 */
  reg_t PLL0FEED;          /* 08C */
  uint32_t gap_090[13];
  reg_t PCONP;             /* 0C4 */
  uint32_t gap_0c8[15];
  reg_t CCLKCFG;           /* 104 */
  reg_t USBCLKCFG;         /* 108 */
  reg_t CLKSRCSEL;         /* 10C */
  uint32_t gap_110[28];
  reg_t RSID;              /* 180 */
  uint32_t gap_184[7];
  reg_t SCS;               /* 1A0 */
  uint32_t gap_1a4;
  reg_t PCLKSEL0;          /* 1A8 */
  reg_t PCLKSEL1;          /* 1AC */
} lpc_syscon_t;

typedef struct {
  reg_t PINSEL0; /* 00 */
  reg_t PINSEL1;
  reg_t PINSEL2;
  reg_t PINSEL3;
  reg_t PINSEL4; /* 10 */
  uint32_t gap_14[11];
  reg_t PINMODE0; /* 40 */
  reg_t PINMODE1;
  reg_t PINMODE2;
  reg_t PINMODE3;
} lpc_pincon_t;

typedef struct {
  reg_t DIR; /* 00 */
  uint32_t gap_04[3];
  reg_t MASK; /* 10 */
  reg_t PIN;  /* 14 */
  reg_t SET;  /* 18 */
  reg_t CLR;  /* 1C */
} lpc_gpio_t;

typedef struct {
  reg_t CR0;      /* 00 */
  reg_t CR1;      /* 04 */
  reg_t DR;       /* 08 */
  reg_read_t SR;  /* 0C */
  reg_t CPSR;     /* 10 */
} lpc_ssp_t;

typedef struct {
  reg_t DATA;     /* 00: RBR read, THR written; DLL with DLAB */
  reg_t IER;      /* 04: DLM with DLAB */
  reg_t FCR;      /* 08: written; IIR read */
  reg_t LCR;      /* 0C */
  uint32_t gap_10;
  reg_read_t LSR; /* 14 */
  uint32_t gap_18[4];
  reg_t FDR;      /* 28 */
  uint32_t gap_2c;
  reg_t TER;      /* 30 */
} lpc_uart_t;

typedef struct {
  reg_t IR;       /* 00 */
  reg_t TCR;      /* 04 */
  reg_t TC;       /* 08 */
  reg_t PR;       /* 0C */
  reg_t PC;       /* 10 */
  reg_t MCR;      /* 14 */
  reg_t MR[4];    /* 18 */
  reg_t CCR;      /* 28 */
  reg_read_t CR[2]; /* 2C */
} lpc_timer_t;

typedef struct {
  reg_t CR;        /* 00 */
  reg_t GDR;       /* 04 */
  uint32_t gap_08;
  reg_t INTEN;     /* 0C */
  reg_read_t DR[8]; /* 10 */
} lpc_adc_t;

typedef struct {
  reg_t MOD;     /* 00 */
  reg_t TC;      /* 04 */
  reg_t FEED;    /* 08 */
  reg_read_t TV; /* 0C */
  reg_t CLKSEL;  /* 10 */
} lpc_wdt_t;

typedef struct {
  uint32_t gap_00[17];
  reg_t GPREG[5]; /* 44 */
} lpc_rtc_t;

#define LPC_WDT ((lpc_wdt_t *)0x40000000u)
#define LPC_UART0 ((lpc_uart_t *)0x4000C000u)
#define LPC_RTC ((lpc_rtc_t *)0x40024000u)
#define LPC_PINCON ((lpc_pincon_t *)0x4002C000u)
#define LPC_SSP1 ((lpc_ssp_t *)0x40030000u)
#define LPC_ADC ((lpc_adc_t *)0x40034000u)
#define LPC_SSP0 ((lpc_ssp_t *)0x40088000u)
#define LPC_TIMER2 ((lpc_timer_t *)0x40090000u)
#define LPC_UART2 ((lpc_uart_t *)0x40098000u)
#define LPC_SYSCON ((lpc_syscon_t *)0x400FC000u)
#define LPC_GPIO0 ((lpc_gpio_t *)0x2009C000u)
#define LPC_GPIO1 ((lpc_gpio_t *)0x2009C020u)
#define LPC_GPIO2 ((lpc_gpio_t *)0x2009C040u)

enum { TIMER2_IRQ = 3, UART0_IRQ = 5, UART2_IRQ = 7, LPC_IRQS = 35 };

/* ---- the Cortex-M3 itself ---- */

#define NVIC_ISER0 (*(reg_t *)0xE000E100u)
#define NVIC_PRIORITY ((volatile uint8_t *)0xE000E400u) /* the upper five bits count */
#define SCB_AIRCR (*(reg_t *)0xE000ED0Cu)

static inline void irq_off(void) { __asm volatile("cpsid i" ::: "memory"); }
static inline void irq_on(void) { __asm volatile("cpsie i" ::: "memory"); }
static inline void wait_for_interrupt(void) { __asm volatile("dsb\n wfi" ::: "memory"); }

/* Interrupts off; what to give irq_restore(). */
static inline uint32_t irq_save(void) {
  uint32_t primask;
  __asm volatile("mrs %0, primask\n cpsid i" : "=r"(primask)::"memory");
  return primask;
}

static inline void irq_restore(uint32_t primask) { __asm volatile("msr primask, %0" ::"r"(primask) : "memory"); }

#endif
