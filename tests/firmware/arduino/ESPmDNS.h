#ifndef ESPMDNS_H
#define ESPMDNS_H

#include <stdint.h>

class MDNSResponder {
public:
    bool begin(const char *host);
    bool addService(const char *service, const char *protocol, uint16_t port);
    void end();
};

extern MDNSResponder MDNS;

#endif
