/* A part of the core whose cost is counted: one file in cost/. */
#ifndef COST_H
#define COST_H

extern const unsigned cost_times; /* number of calls of cost_act */

void cost_prepare(void);
void cost_act(void);

#endif
