// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "report.hpp"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <limits>
#include <numbers>
#include <string_view>
#include <utility>

#include <nlohmann/json.hpp>

#include <cairn/core/check.hpp>
#include <cairn/core/statistics.hpp>
#include <cairn/io/text.hpp>

#include "report_template.hpp"

namespace example {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::string_view data_place = "@CAIRN_REPORT_DATA@";
constexpr std::string_view title_place = "@CAIRN_REPORT_TITLE@";

const char* name_of(Ink ink) {
  constexpr const char* names[] = {"truth", "belief", "measurement", "wrong", "grey", "teal", "violet"};
  return names[static_cast<std::size_t>(ink)];
}

std::string dumped(const Json& json) {
  return json.dump(-1, ' ', false, Json::error_handler_t::replace);
}

void expect_as_many(std::size_t found, std::size_t expected, const std::string& panel,
                    const std::string& curve) {
  if (found != expected)
    cairn::raise("report panel \"" + panel + "\": expected " + std::to_string(expected) + " values of \"" +
                 curve + "\", found " + std::to_string(found));
}

/// Six significant digits: more than a screen shows, and a third of the bytes. Null where not finite.
Json rounded(double value) {
  if (!std::isfinite(value)) return nullptr;
  char text[32];
  const auto printed = std::to_chars(text, text + sizeof text, value, std::chars_format::general, 6);
  return *cairn::parse_number(std::string_view(text, printed.ptr));
}

template <class Values>
Json rounded_all(const Values& values) {
  Json array = Json::array();
  for (const double value : values) array.push_back(rounded(value));
  return array;
}

std::string base64(std::string_view bytes) {
  constexpr char letters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    const std::size_t count = std::min<std::size_t>(3, bytes.size() - i);
    std::uint32_t group = 0;
    for (std::size_t k = 0; k < 3; ++k)
      group = group << 8U | (k < count ? static_cast<std::uint8_t>(bytes[i + k]) : 0U);
    for (std::size_t k = 0; k < 4; ++k) text += k <= count ? letters[group >> (18U - 6U * k) & 63U] : '=';
  }
  return text;
}

/// Floats as the base64 of their bytes, little endian: the page reads them without parsing.
std::string packed(const std::vector<float>& values) {
  std::string bytes;
  bytes.reserve(4 * values.size());
  for (const float value : values) {
    std::uint32_t bits = 0;
    std::memcpy(&bits, &value, sizeof bits);
    for (unsigned shift = 0; shift < 32; shift += 8) bytes += static_cast<char>(bits >> shift & 255U);
  }
  return base64(bytes);
}

template <std::size_t N>
bool all_finite(const std::array<float, N>& numbers) {
  for (const float number : numbers)
    if (!std::isfinite(number)) return false;
  return true;
}

template <std::size_t N>
std::string packed_rows(const std::vector<std::array<float, N>>& rows) {
  std::vector<float> values;
  values.reserve(N * rows.size());
  for (const auto& row : rows)
    if (all_finite(row)) values.insert(values.end(), row.begin(), row.end());
  return packed(values);
}

template <class Panel>
Json head(const char* kind, const Panel& panel) {
  return {{"kind", kind}, {"title", panel.title}, {"caption", panel.caption}, {"wide", panel.wide}};
}

Json axis(const Axis& axis) {
  return {{"label", axis.label}, {"unit", axis.unit}};
}

Json curves_of(const std::string& panel, const std::vector<PlaneCurve>& curves) {
  Json json = Json::array();
  for (const PlaneCurve& curve : curves) {
    expect_as_many(curve.y.size(), curve.x.size(), panel, curve.name);
    json.push_back({{"name", curve.name},
                    {"ink", name_of(curve.ink)},
                    {"dots", curve.dots},
                    {"dashed", curve.dashed},
                    {"filled", curve.filled},
                    {"x", rounded_all(curve.x)},
                    {"y", rounded_all(curve.y)}});
  }
  return json;
}

Json marks_of(const std::vector<Marks>& all) {
  Json json = Json::array();
  for (const Marks& marks : all)
    json.push_back({{"name", marks.name},
                    {"ink", name_of(marks.ink)},
                    {"count", std::max(marks.points.size(), marks.segments.size())},
                    {"points", packed_rows(marks.points)},
                    {"segments", packed_rows(marks.segments)}});
  return json;
}

/// What a plot and a film in the plane have in common.
template <class Panel>
Json plane_head(const char* kind, const Panel& panel) {
  Json json = head(kind, panel);
  json["x"] = axis(panel.x);
  json["y"] = axis(panel.y);
  if constexpr (requires { panel.third; }) json["third"] = panel.third;
  if constexpr (requires { panel.downwards; }) json["downwards"] = panel.downwards;
  json["equal_scale"] = panel.equal_scale;
  return json;
}

/// The text may stand inside a script element: no '<' is left in it.
std::string without_tags(const std::string& json) {
  std::string text;
  text.reserve(json.size());
  for (const char letter : json) letter == '<' ? text += "\\u003c" : text += letter;
  return text;
}

std::string escaped_for_html(const std::string& plain) {
  std::string text;
  for (const char letter : plain) {
    if (letter == '<')
      text += "&lt;";
    else if (letter == '&')
      text += "&amp;";
    else
      text += letter;
  }
  return text;
}

void put(std::string& page, std::string_view place, const std::string& text) {
  const std::size_t position = page.find(place);
  if (position == std::string::npos) cairn::raise("report page: the template lacks " + std::string(place));
  page.replace(position, place.size(), text);
}

}  // namespace

Report::Report(std::string title, std::string subtitle)
    : title_(std::move(title)), subtitle_(std::move(subtitle)) {}

void Report::figure(KeyFigure figure) {
  figures_.push_back(std::move(figure));
}
void Report::note(std::string sentence) {
  notes_.push_back(std::move(sentence));
}

void Report::add(const LinePlot& panel) {
  Json json = head("lines", panel);
  json["x"] = axis(panel.x);
  json["y"] = axis(panel.y);
  json["logarithmic"] = panel.logarithmic;
  json["logarithmic_x"] = panel.logarithmic_x;
  json["x_values"] = rounded_all(panel.x_values);
  json["curves"] = Json::array();
  for (std::size_t i = 0; i < panel.x_values.size(); ++i)
    if (!std::isfinite(panel.x_values[i]) || (i > 0 && panel.x_values[i] < panel.x_values[i - 1]))
      cairn::raise("report panel \"" + panel.title + "\": expected x values that never fall, x value " +
                   std::to_string(i) + " does");
  for (const Curve& curve : panel.curves) {
    expect_as_many(curve.values.size(), panel.x_values.size(), panel.title, curve.name);
    json["curves"].push_back({{"name", curve.name},
                              {"ink", name_of(curve.ink)},
                              {"dashed", curve.dashed},
                              {"dots", curve.dots},
                              {"values", rounded_all(curve.values)}});
  }
  json["bands"] = Json::array();
  for (const Band& band : panel.bands) {
    expect_as_many(band.low.size(), panel.x_values.size(), panel.title, band.name);
    expect_as_many(band.high.size(), panel.x_values.size(), panel.title, band.name);
    json["bands"].push_back({{"name", band.name},
                             {"ink", name_of(band.ink)},
                             {"low", rounded_all(band.low)},
                             {"high", rounded_all(band.high)}});
  }
  panels_.push_back(dumped(json));
}

void Report::add(const PlanePlot& panel) {
  Json json = plane_head("plane", panel);
  json["curves"] = curves_of(panel.title, panel.curves);
  panels_.push_back(dumped(json));
}

void Report::add(const PlaneFilm& panel) {
  Json json = plane_head("film", panel);
  const std::size_t last = panel.frames.empty() ? 0 : panel.frames.size() - 1;
  if (panel.start.value_or(0) > last)
    cairn::raise("report panel \"" + panel.title + "\": expected to start at a frame up to " +
                 std::to_string(last) + ", found " + std::to_string(*panel.start));
  json["slider"] = axis(panel.slider);
  json["start"] = panel.start.value_or(last);
  json["still"] = curves_of(panel.title, panel.still);
  json["frames"] = Json::array();
  for (const PlaneFrame& frame : panel.frames)
    json["frames"].push_back({{"at", rounded(frame.at)},
                              {"caption", frame.caption},
                              {"curves", curves_of(panel.title, frame.curves)}});
  panels_.push_back(dumped(json));
}

void Report::add(const HeatMap& panel) {
  expect_as_many(panel.values.size(), panel.columns * panel.rows, panel.title, panel.value.label);
  Json json = head("heat", panel);
  json["x"] = axis(panel.x);
  json["y"] = axis(panel.y);
  json["value"] = axis(panel.value);
  json["columns"] = panel.columns;
  json["rows"] = panel.rows;
  json["diverging"] = panel.diverging;
  json["values"] = rounded_all(panel.values);
  panels_.push_back(dumped(json));
}

void Report::add(const Picture& panel) {
  Json json = head("picture", panel);
  json["png"] = base64(panel.png);
  json["width"] = panel.width;
  json["height"] = panel.height;
  json["marks"] = marks_of(panel.marks);
  panels_.push_back(dumped(json));
}

void Report::add(const PictureFilm& panel) {
  Json json = head("picture_film", panel);
  json["slider"] = axis(panel.slider);
  json["width"] = panel.width;
  json["height"] = panel.height;
  json["start"] = panel.frames.empty() ? 0 : panel.frames.size() - 1;
  json["frames"] = Json::array();
  for (const PictureFrame& frame : panel.frames)
    json["frames"].push_back({{"at", rounded(frame.at)},
                              {"caption", frame.caption},
                              {"png", base64(frame.png)},
                              {"marks", marks_of(frame.marks)}});
  panels_.push_back(dumped(json));
}

void Report::add(const Table& panel) {
  for (const std::vector<std::string>& row : panel.rows)
    expect_as_many(row.size(), panel.columns.size(), panel.title, "a row");
  Json json = head("table", panel);
  json["columns"] = panel.columns;
  json["rows"] = panel.rows;
  panels_.push_back(dumped(json));
}

void Report::add(const Cloud& panel) {
  Json json = head("cloud", panel);
  json["unit"] = panel.unit;
  json["points"] = packed_rows(panel.points);
  json["colourings"] = Json::array();
  for (const Colouring& colouring : panel.colourings) {
    expect_as_many(colouring.values.size(), panel.points.size(), panel.title, colouring.name);
    std::vector<float> values;
    for (std::size_t i = 0; i < panel.points.size(); ++i)
      if (all_finite(panel.points[i])) values.push_back(static_cast<float>(colouring.values[i]));
    json["colourings"].push_back({{"name", colouring.name},
                                  {"unit", colouring.unit},
                                  {"grey", colouring.grey},
                                  {"values", packed(values)}});
  }
  json["curves"] = Json::array();
  for (const SpaceCurve& curve : panel.curves)
    json["curves"].push_back(
        {{"name", curve.name}, {"ink", name_of(curve.ink)}, {"points", packed_rows(curve.points)}});
  panels_.push_back(dumped(json));
}

std::string Report::data() const {
  constexpr const char* verdicts[] = {"none", "good", "bad"};
  Json json{{"title", title_}, {"subtitle", subtitle_}, {"notes", notes_}, {"figures", Json::array()}};
  for (const KeyFigure& figure : figures_)
    json["figures"].push_back({{"label", figure.label},
                               {"value", figure.value},
                               {"unit", figure.unit},
                               {"hint", figure.hint},
                               {"verdict", verdicts[static_cast<std::size_t>(figure.verdict)]}});
  if (live_ > 0) json["live"] = live_;
  std::string text = dumped(json);
  text.back() = ',';  // the closing brace: the panels are JSON already
  text += "\"panels\":[";
  for (std::size_t i = 0; i < panels_.size(); ++i) text.append(i > 0 ? "," : "").append(panels_[i]);
  return text + "]}";
}

std::optional<std::string> Report::html() const {
  if (!has_report_page()) return std::nullopt;
  std::string page(report_template());
  put(page, title_place, escaped_for_html(title_));
  put(page, data_place, without_tags(data()));
  return page;
}

PlaneCurve ellipse(std::string name, Ink ink, const std::array<double, 2>& mean,
                   const std::array<double, 3>& covariance, double sigmas) {
  const auto [xx, xy, yy] = covariance;
  const double left_over = xx > 0 ? yy - xy * xy / xx : yy;  // of y's variance once x is known
  if (!(xx >= 0 && left_over >= -1e-9 * yy && (xx > 0 || xy == 0)))
    cairn::raise("ellipse \"" + name +
                 "\": expected a covariance (xx, xy, yy) without a negative eigenvalue, " + "found (" +
                 readable(xx) + ", " + readable(xy) + ", " + readable(yy) + ")");
  // The lower Cholesky factor carries the circle of radius `sigmas` to the ellipse.
  const double along = std::sqrt(xx);
  const double across = xx > 0 ? xy / along : 0;
  const double upwards = std::sqrt(std::max(left_over, 0.0));
  constexpr int corners = 48;
  PlaneCurve curve{.name = std::move(name), .ink = ink, .filled = true};
  for (int corner = 0; corner <= corners; ++corner) {
    const double angle = 2 * std::numbers::pi * corner / corners;
    const double u = sigmas * std::cos(angle);
    const double v = sigmas * std::sin(angle);
    curve.x.push_back(mean[0] + along * u);
    curve.y.push_back(mean[1] + across * u + upwards * v);
  }
  return curve;
}

Spreads spreads_along(const std::vector<PlaneGaussian>& path, Ink ink, double sigmas) {
  Spreads result{.curve = {.ink = ink, .filled = true}};
  if (path.empty()) return result;
  std::vector<double> along;  // the longer half axes
  std::array<double, 2> low = path.front().mean, high = low;
  for (const PlaneGaussian& place : path) {
    const auto [xx, xy, yy] = place.covariance;
    const double middle = 0.5 * (xx + yy);
    along.push_back(sigmas * std::sqrt(middle + std::hypot(middle - yy, xy)));
    for (std::size_t i = 0; i < 2; ++i) {
      low[i] = std::min(low[i], place.mean[i]);
      high[i] = std::max(high[i], place.mean[i]);
    }
  }
  // From one to the next the tenth longest nearly meet.
  const double apart = 0.07 * std::max({high[0] - low[0], high[1] - low[1], 1.0});
  const double most = std::max(1.0, 0.5 * apart / std::max(cairn::quantile(along, 0.9), 1e-6));
  const double decade = std::pow(10.0, std::floor(std::log10(most)));
  result.scale = decade * std::floor(most / decade);
  result.curve.name = readable(sigmas) + " sigma, " + readable(result.scale) + " times as large";
  std::vector<std::array<double, 2>> drawn;
  for (const PlaneGaussian& place : path) {
    const auto near = [&](const std::array<double, 2>& other) {
      return std::hypot(other[0] - place.mean[0], other[1] - place.mean[1]) < apart;
    };
    if (std::ranges::any_of(drawn, near)) continue;
    drawn.push_back(place.mean);
    const PlaneCurve one =
        ellipse(result.curve.name, ink, place.mean, place.covariance, sigmas * result.scale);
    for (auto [all, own] : {std::pair{&result.curve.x, &one.x}, std::pair{&result.curve.y, &one.y}}) {
      all->insert(all->end(), own->begin(), own->end());
      all->push_back(std::numeric_limits<double>::quiet_NaN());  // between two of them no line
    }
  }
  return result;
}

PlaneCurve area(std::string name, Ink ink, const std::vector<double>& x, const std::vector<double>& low,
                const std::vector<double>& high) {
  expect_as_many(low.size(), x.size(), "area", name);
  expect_as_many(high.size(), x.size(), "area", name);
  PlaneCurve curve{.name = std::move(name), .ink = ink, .x = x, .y = high, .filled = true};
  curve.x.insert(curve.x.end(), x.rbegin(), x.rend());
  curve.y.insert(curve.y.end(), low.rbegin(), low.rend());
  return curve;
}

bool has_report_page() noexcept {
  return !report_template().empty();
}

std::string why_no_report() {
  return "no report.html: this program was built without npm; install nodejs and npm, build again with a "
         "network once";
}

std::string readable(double value, int digits) {
  if (!std::isfinite(value)) return "none";
  char text[64];
  const bool whole = std::abs(value) >= std::pow(10.0, digits) - 0.5 && std::abs(value) < 1e6;
  const auto printed =
      whole ? std::to_chars(text, text + sizeof text, value, std::chars_format::fixed, 0)
            : std::to_chars(text, text + sizeof text, value, std::chars_format::general, digits);
  return {text, printed.ptr};
}

ReadableLength readable_length(double metres) {
  const double size = std::abs(metres);
  if (size >= 1e-5 && size < 1e-2) return {readable(1e3 * metres), "mm"};
  if (size > 0 && size < 1e-5) return {readable(1e6 * metres), "um"};
  return {readable(metres), "m"};
}

}  // namespace example
