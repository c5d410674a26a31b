#ifndef PORT_H
#define PORT_H

/* What the files of this port share. */

#include <stddef.h>
#include <stdint.h>

#include "gf_bus.h"
#include "gf_ring.h"
#include "lpc1768.h"

enum { CORE_HZ = 96000000 };

/* main.c */
__attribute__((noreturn)) void port_main(void);
void port_tick(uint64_t ticks, uint32_t missed); /* a sampling instant, in the interrupt */

/* startup.c */
uint32_t port_free_stack(void); /* bytes that the stack never reached */

/* system.c */
void system_start(void); /* clocks, power, pins, straps */
__attribute__((noreturn)) void port_reset(void);
void watchdog_start(void);
void watchdog_feed(void);
uint8_t system_next_epoch(void);
void system_uid(uint8_t uid[16]);
int system_is_simulated(void);
void system_leds(int alive, int fault);

/* time.c: TIMER2 */
void time_start(void);
uint64_t time_now(void *context);
void time_set_period(void *context, uint32_t ticks);
uint64_t time_idle(void *context);
void time_sleep(void); /* until an interrupt; interrupts are off before and after */
int time_has_news(void); /* a pulse, or 10 ms have passed; forgets them */
gf_capture_t time_tacho(void);
gf_capture_t time_pps(void);
void timer2_handler(void);

/* spi.c: SSP0 and SSP1 */
void spi_start(void);
uint8_t spi_exchange(void *context, uint8_t device_mask, const uint16_t *out, uint16_t in[][GF_SPI_WORDS], uint8_t n);
void spi_pause(void *context);

/* uart.c: UART0 to the host, UART2 from the receiver */
void uart_start(void);
void uart_service(void); /* a change of rate that waits for its moment */
int uart_is_idle(void);  /* everything written to the host has left */
int uart_has_input(void);
gf_line_t uart_host(void);
gf_line_t uart_gnss(void);
void uart0_handler(void);
void uart2_handler(void);

/* adc.c */
uint8_t adc_read(void *context, uint8_t channel_mask, uint16_t *values);

#endif
