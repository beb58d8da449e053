// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "arena_cache.hpp"

#include <cstddef>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string_view>
#include <system_error>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>

namespace stereo_slam {
namespace {

// To be raised whenever the renderer, the ground or the scripts change: older pictures are then not found.
constexpr int picture_version = 1;

std::uint64_t mix(std::uint64_t hash, std::uint64_t word) {
  hash = (hash ^ word) * 0x9e3779b97f4a7c15ULL;
  return hash ^ (hash >> 29U);
}

// A checksum against damage, not against malice.
std::uint64_t checksum(std::string_view bytes) {
  std::uint64_t hash = bytes.size();
  std::size_t i = 0;
  for (; i + 8 <= bytes.size(); i += 8) {
    std::uint64_t word = 0;
    std::memcpy(&word, bytes.data() + i, 8);
    hash = mix(hash, word);
  }
  for (; i < bytes.size(); ++i) hash = mix(hash, static_cast<unsigned char>(bytes[i]));
  return mix(hash, hash >> 32U);
}

std::string in_hex(std::uint64_t value) {
  char text[17];
  std::snprintf(text, sizeof text, "%016llx", static_cast<unsigned long long>(value));
  return text;
}

std::filesystem::path default_folder() {
  if (const char* cache = std::getenv("XDG_CACHE_HOME"); cache != nullptr && *cache == '/')
    return std::filesystem::path(cache) / "cairn";
  if (const char* home = std::getenv("HOME"); home != nullptr && *home == '/')
    return std::filesystem::path(home) / ".cache" / "cairn";
  std::error_code failure;
  return std::filesystem::temp_directory_path(failure) / "cairn";
}

// One folder a set of options: its name carries everything that the pictures depend on.
std::string key(const ArenaOptions& options) {
  char text[256];
  std::snprintf(text, sizeof text, "%d %s %llu %d %d %a %a %a %a %a", picture_version, options.script.c_str(),
                static_cast<unsigned long long>(options.seed), options.width, options.height,
                options.field_of_view, options.baseline, options.noise, options.exposure, options.drift);
  return "arena-" + options.script + "-" + in_hex(checksum(text));
}

std::string header(int width, int height, std::string_view pixels) {
  return "P5\n# cairn arena " + in_hex(checksum(pixels)) + "\n" + std::to_string(width) + " " +
         std::to_string(2 * height) + "\n255\n";
}

void append(std::string& pixels, const cairn::Image& image) {
  pixels.append(reinterpret_cast<const char*>(image.row(0)),
                static_cast<std::size_t>(image.width()) * static_cast<std::size_t>(image.height()));
}

}  // namespace

ArenaCache::ArenaCache(const ArenaOptions& options)
    : enabled_(options.cache),
      width_(options.width),
      height_(options.height),
      folder_((options.cache_folder.empty() ? default_folder() : options.cache_folder) / key(options)) {
  std::error_code failure;
  if (enabled_) std::filesystem::create_directories(folder_, failure);
}

std::filesystem::path ArenaCache::file(std::size_t frame) const {
  char name[32];
  std::snprintf(name, sizeof name, "%06zu.pgm", frame);
  return folder_ / name;
}

std::optional<ImagePair> ArenaCache::find(std::size_t frame) const {
  std::error_code failure;
  if (!enabled_ || !std::filesystem::is_regular_file(file(frame), failure)) return std::nullopt;
  std::string bytes;
  try {
    bytes = cairn::read_file(file(frame), "a rendered pair");
  } catch (const cairn::Error&) {
    return std::nullopt;  // removed or unreadable since
  }
  const std::size_t size = static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_);
  if (bytes.size() < 2 * size) return std::nullopt;
  const std::string_view pixels = std::string_view(bytes).substr(bytes.size() - 2 * size);
  if (bytes.compare(0, bytes.size() - 2 * size, header(width_, height_, pixels)) != 0) return std::nullopt;
  ImagePair pair{cairn::Image(width_, height_), cairn::Image(width_, height_)};
  std::memcpy(pair.first.row(0), pixels.data(), size);
  std::memcpy(pair.second.row(0), pixels.data() + size, size);
  return pair;
}

void ArenaCache::keep(std::size_t frame, const ImagePair& pair) const {
  if (!enabled_) return;
  std::string pixels;
  append(pixels, pair.first);
  append(pixels, pair.second);
  try {
    cairn::write_file_atomically(file(frame), header(width_, height_, pixels) + pixels);
  } catch (const cairn::Error&) {
    return;  // the next run renders it again
  }
}

}  // namespace stereo_slam
