/* On a board: the same lines over its serial port. */
#ifdef ARDUINO
#include <Arduino.h>

#include <stdio.h>

extern "C" int gyrocal_main(int argc, char **argv);

void setup() {
    delay(2000);
    gyrocal_main(0, nullptr);
    fflush(stdout);
}

void loop() {
    delay(1000);
}
#endif
