/* The chip, which a board's flags may name. */
#ifndef SDKCONFIG_H
#define SDKCONFIG_H

#if !defined(CONFIG_IDF_TARGET_ESP32C3) && !defined(CONFIG_IDF_TARGET_ESP32S3)
#define CONFIG_IDF_TARGET_ESP32 1
#endif

#endif
