/* Why the board has started, in words; docs/board.md says what to do. */
#ifndef RESET_REASON_H
#define RESET_REASON_H

#include <esp_system.h>

const char *reset_reason_name(esp_reset_reason_t reason);

#endif
