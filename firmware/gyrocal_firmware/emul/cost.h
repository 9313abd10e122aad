/* A part of the core whose cost is counted: one file in cost/. */
#ifndef COST_H
#define COST_H

extern const unsigned cost_times; /* how often cost_act is called */

void cost_prepare(void);
void cost_act(void);

#endif
