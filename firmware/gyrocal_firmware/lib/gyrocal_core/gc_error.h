/* Error codes. Every failure has a unique code, a name for programs and a piece of advice for people. */
#ifndef GC_ERROR_H
#define GC_ERROR_H

#ifdef __cplusplus
extern "C" {
#endif

/* X(identifier, code, name, advice) */
#define GC_ERRORS(X)                                                                                                     \
    X(GC_E_BUS_NACK, -1, "bus_nack", "the sensor does not answer: check wiring and power and address")                   \
    X(GC_E_BUS_SHORT, -2, "bus_short", "the sensor sent too few bytes: shorten the cable or slow the bus")               \
    X(GC_E_WRONG_ID, -3, "wrong_id", "another part answers at this address: connect the one that hello names or set sensor auto")           \
    X(GC_E_RESET_TIMEOUT, -4, "reset_timeout", "the sensor does not come out of reset: power it off and on")             \
    X(GC_E_CONFIG_REFUSED, -5, "config_refused", "the sensor did not keep its settings: power it off and on")            \
    X(GC_E_CONFIG_LOST, -6, "config_lost", "the sensor lost its settings: check its supply for brown-outs")              \
    X(GC_E_STALE, -7, "stale", "the sensor gives no new samples: power it off and on")                                   \
    X(GC_E_STUCK_BIT, -8, "stuck_bit", "a bit of the reading never changes: replace the sensor")                         \
    X(GC_E_CLIPPED, -9, "clipped", "the rate reached full scale: set full_scale_dps higher")                             \
    X(GC_E_NOT_ONE_G, -10, "not_one_g", "at rest the accelerometer is far from 1 g: is it a DSO32 or moving")            \
    X(GC_E_NOT_READY, -11, "not_ready", "the sensor is not set up yet: see the error before")                            \
    X(GC_E_FIFO_OVERRUN, -12, "fifo_overrun", "the FIFO was full and samples are lost: lower rate_hz or fifo")                \
    X(GC_E_FIFO_TAG, -13, "fifo_tag", "the FIFO's words came damaged: shorten the cable or slow the bus")                \
    X(GC_E_REPEATED, -14, "repeated", "readings came more than once: lower rate_hz or power the sensor off and on")      \
    X(GC_E_PART_FILE, -15, "part_file", "this sensor needs its maker's configuration file: see Sensors in docs/board.md")       \
    X(GC_E_PART_FILE_REFUSED, -16, "part_file_refused", "the sensor did not take its configuration file: check file and cable") \
    X(GC_E_NO_SPI, -17, "no_spi", "this sensor does not speak SPI: wire it to I2C or connect another")                         \
    X(GC_E_SPI_NEEDED, -18, "spi_needed", "too many samples for I2C: set a slower rate_hz or wire the sensor to SPI")            \
    X(GC_E_COMMAND, -20, "unknown_command", "see PROTOCOL.md for the commands")                                          \
    X(GC_E_ARGUMENT, -21, "bad_argument", "see PROTOCOL.md for what the command takes")                                  \
    X(GC_E_LINE_TOO_LONG, -22, "line_too_long", "a command has at most 80 bytes")                                        \
    X(GC_E_RECORDING, -23, "recording", "a run is going on: send stop first")                                            \
    X(GC_E_NO_RUN, -24, "no_run", "no run is going on: send start first")                                                \
    X(GC_E_STORE, -25, "store_failed", "it holds until power-off: the board could not keep it")                 \
    X(GC_E_FIFO_RATE, -26, "fifo_rate", "the FIFO keeps the sensor's own time: set one of its rates as rate_hz; or fifo 0")    \
    X(GC_E_FIFO_NEEDED, -27, "fifo_needed", "too fast for single samples: set a slower rate_hz and fifo 16 and then this")   \
    X(GC_E_NO_SELF_TEST, -28, "no_self_test", "this sensor has no self-test that the firmware knows: nothing to do")            \
    X(GC_E_NO_NETWORK, -29, "no_network", "there is no network to join: send wifi name and wifi token first")            \
    X(GC_E_DIRECTION, -30, "wrong_direction", "the reading opposes the true rate: check table_dps and face and axis")       \
    X(GC_E_TOO_SHORT, -31, "too_short", "the run has too few samples: record at least 2 s")                              \
    X(GC_E_NO_REST, -32, "no_rest", "a turn needs the bias: record a run at rest first")                                 \
    X(GC_E_NOT_CALIBRATED, -33, "not_calibrated", "no axis has a scale and bias yet: record a run up and a run down")      \
    X(GC_E_NO_UNDO, -34, "no_undo", "no earlier correction is kept: nothing changed")                                      \
    X(GC_E_FACE, -35, "wrong_face", "gravity says the other face: check the face given and how the sensor is mounted")     \
    X(GC_E_NO_PAIR, -36, "no_pair", "axis or full scale or rate_hz or table_dps is not that of the run before: repeat it") \
    X(GC_E_TABLE_RATE, -37, "table_rate", "the reading is over 3 percent off table_dps: check the table or set table_dps") \
    X(GC_E_STREAM_RATE, -38, "stream_rate", "text carries no stream at this rate_hz: send stream packed or off or set a slower one") \
    X(GC_E_UNIDENTIFIED, -40, "unidentified", "the runs do not tell the terms apart: give priors or fewer effects")      \
    X(GC_E_PRIOR_COUPLED, -41, "prior_coupled", "the prior ties a run's own effects to shared terms: export again")      \
    X(GC_E_TOO_MANY_COLUMNS, -42, "too_many_columns", "the calibration has over 8 effect columns: export fewer")         \
    X(GC_E_WHITE_NOISE, -43, "no_white_noise", "the calibration has no white noise: export again")                       \
    X(GC_E_CALIBRATION_AXIS, -44, "calibration_axis", "the calibration is for another axis: set axis or export again")   \
    X(GC_E_MISFIT, -45, "misfit", "the readings do not fit the calibration's model: record a session and diagnose it")   \
    X(GC_E_CALIBRATION_NUMBER, -46, "calibration_number", "the calibration holds a number that is not finite: export again") \
    X(GC_E_CORRECTION, -47, "correction", "no true rate explains the reading by this model: export the model again")           \
    X(GC_E_NET_SAMPLE_RATE, -50, "net_sample_rate", "the network was trained for another rate_hz: set it or export again")\
    X(GC_E_NET_RATE, -51, "net_table_rate", "the network was trained for another table rate: set it or export again")    \
    X(GC_E_NET_WINDOW, -52, "net_window", "the network's window does not fit this firmware: export again")               \
    X(GC_E_NET_MEMORY, -53, "net_memory", "the network needs more memory than this firmware has: export a smaller one")  \
    X(GC_E_NET_INPUT, -54, "net_input", "the network was given a reading that is no number: report this")                \
    X(GC_E_NET_GAP, -55, "net_gap", "samples are missing in a window of the network: see missed in status; run again")    \
    X(GC_E_NET_RANGE, -56, "net_range", "readings beyond what the network was trained on: record a session and diagnose") \
    X(GC_E_WIRE_START, -60, "wire_start", "the line is no sentence: it must start with a dollar sign")                   \
    X(GC_E_WIRE_CRC, -61, "wire_crc", "the sentence was damaged on its way: check cable and speed")                      \
    X(GC_E_WIRE_SYNTAX, -62, "wire_syntax", "the sentence is malformed: update firmware and host to one version")        \
    X(GC_E_WIRE_TOO_LONG, -63, "wire_too_long", "the line is longer than 320 bytes: check the port's speed")             \
    X(GC_E_NUMBER, -64, "bad_number", "write a decimal number such as -78 or 1.5e-3")                                    \
    X(GC_E_TOKEN, -65, "wrong_token", "give the token that was set by wifi token")

enum gc_error {
    GC_OK = 0,
#define GC_ERROR_ENUM(id, code, name, advice) id = (code),
    GC_ERRORS(GC_ERROR_ENUM)
#undef GC_ERROR_ENUM
};

/* "unknown" for a code that is not in the list. */
const char *gc_error_name(int code);
const char *gc_error_advice(int code);

#ifdef __cplusplus
}
#endif

#endif
