// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// Point clouds for viewers: PLY, binary little endian, one element "vertex" with named properties.
///
/// MeshLab, CloudCompare, Open3D, PCL and Blender show x y z (float) and red green blue (uchar) as they are
/// and keep further properties. Format: G. Turk, "The PLY polygon file format", 1994.
#pragma once

#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <span>
#include <string>
#include <type_traits>
#include <variant>
#include <vector>

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>
#include <cairn/version.hpp>

namespace cairn { inline namespace CAIRN_ABI {

/// One column of a point cloud: a name without blanks and a value for each point. Does not own the values.
struct PlyProperty {
  using Values = std::variant<std::span<const float>, std::span<const double>, std::span<const std::uint8_t>,
                              std::span<const std::int32_t>>;
  std::string name;
  Values values;

  [[nodiscard]] std::size_t size() const {
    return std::visit([](const auto& numbers) { return numbers.size(); }, values);
  }
};

namespace detail {

inline const char* ply_type(const PlyProperty& property) noexcept {
  constexpr const char* names[] = {"float", "double", "uchar", "int"};
  return names[property.values.index()];
}

template <class Value>
void append_little_endian(std::string& bytes, Value value) {
  char raw[sizeof(Value)];
  std::memcpy(raw, &value, sizeof value);
  if constexpr (std::endian::native == std::endian::big)
    bytes.append(std::reverse_iterator(raw + sizeof raw), std::reverse_iterator(raw));
  else
    bytes.append(raw, sizeof raw);
}

/// Throws Error naming the first number that is not finite: viewers differ in what they make of it.
inline void expect_finite(const PlyProperty& property) {
  const auto check = [&](const auto& values) {
    if constexpr (std::is_floating_point_v<std::decay_t<decltype(values[0])>>)
      for (std::size_t i = 0; i < values.size(); ++i)
        if (!std::isfinite(values[i]))
          raise("PLY: expected finite numbers, property '" + property.name + "' of point " +
                std::to_string(i) + " is none");
  };
  std::visit(check, property.values);
}

}  // namespace detail

/// The bytes of a PLY file with one vertex a point. All properties have the same size; comments are single
/// lines. The same input gives the same bytes on every platform. Throws Error where a number is not finite.
[[nodiscard]] inline std::string ply_bytes(std::span<const PlyProperty> properties,
                                           std::span<const std::string> comments = {}) {
  CAIRN_EXPECTS(!properties.empty(), "a point cloud needs at least one property");
  const std::size_t count = properties.front().size();
  std::string bytes = "ply\nformat binary_little_endian 1.0\n";
  for (const std::string& comment : comments) {
    CAIRN_EXPECTS(comment.find('\n') == std::string::npos, "a comment is a single line");
    bytes += "comment " + comment + "\n";
  }
  bytes += "element vertex " + std::to_string(count) + "\n";
  for (const PlyProperty& property : properties) {
    CAIRN_EXPECTS(property.size() == count, "all properties have one value a point");
    CAIRN_EXPECTS(!property.name.empty() && property.name.find_first_of(" \t\r\n") == std::string::npos,
                  "a property's name has no blanks");
    detail::expect_finite(property);
    bytes += std::string("property ") + detail::ply_type(property) + " " + property.name + "\n";
  }
  bytes += "end_header\n";
  for (std::size_t point = 0; point < count; ++point)
    for (const PlyProperty& property : properties)
      std::visit([&](const auto& values) { detail::append_little_endian(bytes, values[point]); },
                 property.values);
  return bytes;
}

/// Writes ply_bytes(properties, comments) completely or not at all. Throws Error naming the path, or before
/// anything is written as ply_bytes does.
inline void write_ply(const std::filesystem::path& path, std::span<const PlyProperty> properties,
                      std::span<const std::string> comments = {}) {
  write_file_atomically(path, ply_bytes(properties, comments));
}

}}  // namespace cairn::CAIRN_ABI
