/* A wireless network and the readers in it. What a reader is told goes to stderr, line by line, with its number in front. */
#include "ESPmDNS.h"
#include "WiFi.h"
#include "lwip/sockets.h"
#include "simulated_board.h"

#include <cerrno>
#include <cstdio>
#include <cstring>
#include <deque>
#include <istream>
#include <string>

#define SEND_BYTES 5744 /* that lwIP keeps of a connection until the reader has them */
#define SERVER 100
#define READERS 4

WiFiClass WiFi;
MDNSResponder MDNS;

static std::string there_name, there_password; /* the network that is there */
static std::string name, password;             /* the one to join; empty = none */
static bool serves;
static std::deque<int> comers;

static struct {
    bool open, stalls, left;
    std::deque<char> says;
    std::string waits, line;
} readers[READERS];

static bool is_joined() {
    return !name.empty() && name == there_name && password == there_password;
}

void WiFiClass::persistent(bool) {
}

bool WiFiClass::setHostname(const char *) {
    return true;
}

bool WiFiClass::mode(wifi_mode_t) {
    return true;
}

wl_status_t WiFiClass::begin(const char *to, const char *by) {
    name = to;
    password = by != nullptr ? by : "";
    return WL_DISCONNECTED;
}

bool WiFiClass::disconnect(bool) {
    name.clear();
    return true;
}

wl_status_t WiFiClass::status() {
    return is_joined() ? WL_CONNECTED : WL_DISCONNECTED;
}

IPAddress WiFiClass::localIP() {
    return {};
}

uint8_t *WiFiClass::macAddress(uint8_t *mac) {
    static const uint8_t ours[6] = {0x24, 0x0a, 0xc4, 0x1a, 0x2b, 0x3c};
    memcpy(mac, ours, sizeof ours);
    return mac;
}

String IPAddress::toString() const {
    return "192.168.1.7";
}

bool MDNSResponder::begin(const char *host) {
    fprintf(stderr, "host %s\n", host);
    return true;
}

bool MDNSResponder::addService(const char *service, const char *protocol, uint16_t port) {
    fprintf(stderr, "service _%s._%s %d\n", service, protocol, port);
    return true;
}

void MDNSResponder::end() {
}

static void deliver(int i) {
    for (const char byte : readers[i].waits) {
        readers[i].line += byte;
        if (byte == '\n') {
            fprintf(stderr, "%d %s", i, readers[i].line.c_str());
            readers[i].line.clear();
        }
    }
    readers[i].waits.clear();
}

extern "C" {
int lwip_socket(int, int, int) {
    return SERVER;
}

int lwip_bind(int, const struct sockaddr *, socklen_t) {
    return 0;
}

int lwip_listen(int, int) {
    serves = true;
    return 0;
}

int lwip_setsockopt(int, int, int, const void *, socklen_t) {
    return 0;
}

int lwip_fcntl(int, int, int) {
    return 0;
}

int lwip_accept(int, struct sockaddr *, socklen_t *) {
    if (comers.empty()) {
        errno = EWOULDBLOCK;
        return -1;
    }
    const int comer = comers.front();
    comers.pop_front();
    return comer;
}

ssize_t lwip_recv(int s, void *data, size_t n, int) {
    auto &reader = readers[s];
    size_t got = 0;
    for (; got < n && !reader.says.empty(); got++) {
        static_cast<char *>(data)[got] = reader.says.front();
        reader.says.pop_front();
    }
    if (got == 0 && !reader.left) {
        errno = EWOULDBLOCK;
        return -1;
    }
    return static_cast<ssize_t>(got);
}

ssize_t lwip_send(int s, const void *data, size_t n, int) {
    auto &reader = readers[s];
    if (reader.left) {
        errno = ECONNRESET;
        return -1;
    }
    const size_t fits = SEND_BYTES - reader.waits.size() < n ? SEND_BYTES - reader.waits.size() : n;
    if (fits == 0) {
        errno = EWOULDBLOCK;
        return -1;
    }
    reader.waits.append(static_cast<const char *>(data), fits);
    if (!reader.stalls) {
        deliver(s);
    }
    return static_cast<ssize_t>(fits);
}

/* What stands unread breaks the connection off, and the reader does not get what it has not seen yet. */
int lwip_close(int s) {
    if (s == SERVER) {
        serves = false;
        return 0;
    }
    if (!readers[s].says.empty()) {
        fprintf(stderr, "%d broken off\n", s);
    }
    return lwip_shutdown(s, 0);
}

int lwip_shutdown(int s, int) {
    if (readers[s].open) {
        fprintf(stderr, "%d closed\n", s);
    }
    readers[s].open = false;
    return 0;
}
}

void set_network(std::istream &words) {
    there_name.clear();
    there_password.clear();
    words >> there_name;
    std::getline(words >> std::ws, there_password);
}

void act_as_reader(unsigned i, const std::string &word, std::istream &words) {
    auto &reader = readers[i];
    if (word == "comes") {
        reader = {};
        reader.open = true;
        if (serves) {
            comers.push_back(static_cast<int>(i));
        } else {
            fprintf(stderr, "%u refused\n", i);
        }
    } else if (word == "says" || word == "types") {
        std::string text;
        std::getline(words >> std::ws, text);
        text += word == "says" ? "\n" : "";
        reader.says.insert(reader.says.end(), text.begin(), text.end());
    } else if (word == "leaves") {
        reader.left = true;
    } else {
        reader.stalls = word == "stalls";
        if (!reader.stalls) {
            deliver(static_cast<int>(i));
        }
    }
}
