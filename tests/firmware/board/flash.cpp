/* Flash that keeps its content in a file. */
#include "Preferences.h"
#include "nvs_flash.h"
#include "simulated_board.h"

#include <cstring>
#include <fstream>
#include <map>
#include <string>

#define FLASH_WRITE_US 20000

static std::string flash_path;
static std::map<std::string, std::string> flash;
static std::map<const Preferences *, std::string> opened;

void read_flash(const char *path) {
    flash_path = path;
    std::ifstream file(flash_path, std::ios::binary);
    std::string key;
    size_t n;
    while (file >> key >> n) {
        std::string value(n, '\0');
        file.get();
        file.read(&value[0], static_cast<std::streamsize>(n));
        flash[key] = value;
    }
}

extern "C" {
esp_err_t nvs_flash_init_partition(const char *) {
    return fails.count("flash") > 0 ? ESP_ERR_NOT_FOUND : fails.count("nvs") > 0 ? ESP_ERR_NVS_NO_FREE_PAGES : ESP_OK;
}

esp_err_t nvs_flash_erase_partition(const char *) {
    fails.erase("nvs");
    flash.clear();
    return ESP_OK;
}

const char *esp_err_to_name(esp_err_t error) {
    return error == ESP_ERR_NOT_FOUND ? "ESP_ERR_NOT_FOUND" : "ESP_ERR_NVS_NO_FREE_PAGES";
}
}

bool Preferences::begin(const char *name, bool read_only, const char *partition) {
    const std::string path = std::string(partition) + "/" + name + "/";
    const auto first = flash.lower_bound(path);
    if (nvs_flash_init_partition(partition) != ESP_OK || (read_only && (first == flash.end() || first->first.compare(0, path.size(), path) != 0))) {
        return false;
    }
    opened[this] = path;
    return true;
}

void Preferences::end() {
    opened.erase(this);
}

bool Preferences::clear() {
    const std::string path = opened[this];
    for (auto kept = flash.lower_bound(path); kept != flash.end() && kept->first.compare(0, path.size(), path) == 0;) {
        kept = flash.erase(kept);
    }
    return true;
}

bool Preferences::isKey(const char *key) {
    return flash.count(opened[this] + key) > 0;
}

/* While flash is written nothing else runs. */
size_t Preferences::putBytes(const char *key, const void *value, size_t n) {
    if (opened.count(this) == 0) {
        return 0;
    }
    now_us += FLASH_WRITE_US;
    if (strlen(key) > 15) {
        return 0;
    }
    flash[opened[this] + key] = std::string(static_cast<const char *>(value), n);
    std::ofstream file(flash_path, std::ios::binary);
    for (const auto &kept : flash) {
        file << kept.first << ' ' << kept.second.size() << '\n' << kept.second;
    }
    return n;
}

size_t Preferences::getBytesLength(const char *key) {
    return flash[opened[this] + key].size();
}

size_t Preferences::getBytes(const char *key, void *buffer, size_t n) {
    const std::string &kept = flash[opened[this] + key];
    memcpy(buffer, kept.data(), kept.size() < n ? kept.size() : n);
    return kept.size();
}
