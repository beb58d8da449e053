// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
#include "rig_file.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <initializer_list>
#include <span>
#include <vector>

#ifdef EXAMPLES_HAVE_YAML
#include <yaml-cpp/yaml.h>
#endif

#include <cairn/core/check.hpp>
#include <cairn/io/file.hpp>
#include <cairn/io/text.hpp>

namespace example {
namespace {

constexpr int format_version = 1;

#ifdef EXAMPLES_HAVE_YAML

constexpr std::size_t most_bytes = 1 << 20;
constexpr double longest_side = 65536;  ///< of an image [pixels]

/// A mapping of the file: its fields by name, every refusal with the way to it.
class Fields {
public:
  Fields(YAML::Node node, std::string file, std::string path)
      : node_(std::move(node)), file_(std::move(file)), path_(std::move(path)) {
    if (!node_.IsMap()) refuse("expected fields 'name: value'");
    std::vector<std::string> seen;
    for (const auto& entry : node_) {
      if (!entry.first.IsScalar()) refuse("a field's name is not a word");
      const std::string& key = entry.first.Scalar();
      if (std::ranges::find(seen, key) != seen.end())
        refuse("the field " + full(key) + " stands there twice");
      seen.push_back(key);
    }
  }

  [[nodiscard]] bool has(const std::string& key) const { return find(key).has_value(); }

  /// A typing error is not to be passed over.
  void expect_only(std::initializer_list<const char*> known) const {
    for (const auto& entry : node_) {
      const std::string& key = entry.first.Scalar();
      if (std::ranges::find(known, key) != known.end()) continue;
      std::string names;
      for (const char* name : known) names += (names.empty() ? "" : ", ") + std::string(name);
      refuse("there is no field " + full(key) + "; expected " + names);
    }
  }

  [[nodiscard]] Fields part(const std::string& key) const {
    return {required(key, "fields below it"), file_, full(key)};
  }

  /// A list of numbers, or one of OpenCV's matrices of them.
  [[nodiscard]] std::vector<double> numbers(const std::string& key, const std::string& expected) const {
    YAML::Node list = required(key, expected);
    if (list.IsMap()) {
      const Fields matrix(list, file_, full(key));
      const auto data = matrix.find("data");
      if (!data) refuse("the field " + full(key) + " has no list 'data'; expected " + expected);
      list = *data;
    }
    if (!list.IsSequence()) refuse("the field " + full(key) + " is no list; expected " + expected);
    std::vector<double> values;
    for (const auto& row : list) {  // a matrix may be a list of its rows
      if (!row.IsSequence()) {
        values.push_back(number(row, key, expected));
        continue;
      }
      for (const auto& one : row) values.push_back(number(one, key, expected));
    }
    return values;
  }

  template <std::size_t n>
  [[nodiscard]] std::array<double, n> numbers_of(const std::string& key, const std::string& names) const {
    const std::string expected = std::to_string(n) + " finite numbers [" + names + "]";
    const std::vector<double> values = numbers(key, expected);
    if (values.size() != n)
      refuse("the field " + full(key) + " has " + std::to_string(values.size()) + " numbers; expected " +
             expected);
    std::array<double, n> result;
    std::ranges::copy(values, result.begin());
    return result;
  }

  /// Standard deviations, where they are there.
  template <std::size_t n>
  [[nodiscard]] std::optional<std::array<double, n>> sigmas_of(const std::string& key,
                                                               const std::string& names) const {
    if (!has(key)) return std::nullopt;
    const std::array<double, n> sigmas = numbers_of<n>(key, names);
    for (const double sigma : sigmas)
      if (sigma < 0) refuse("the field " + full(key) + " has a negative standard deviation");
    return sigmas;
  }

  [[nodiscard]] std::string word(const std::string& key, const std::string& expected) const {
    const YAML::Node node = required(key, expected);
    if (!node.IsScalar()) refuse("the field " + full(key) + " is no single word; expected " + expected);
    return node.Scalar();
  }

  [[noreturn]] void refuse(const std::string& why) const {
    cairn::raise(file_ + ": " + (path_.empty() ? "" : path_ + ": ") + why);
  }
  /// A side of an image.
  [[nodiscard]] int side(double value, const std::string& key) const {
    if (!(value >= 1 && value <= longest_side && value == std::floor(value)))
      refuse("the field " + full(key) + " has " + cairn::shortest(value) +
             "; expected whole pixels, 1 to 65536 a side");
    return static_cast<int>(value);
  }
  /// What `make` makes; where that throws, this file and field are named.
  template <class Make>
  [[nodiscard]] auto made(const Make& make) const {
    try {
      return make();
    } catch (const cairn::Error& error) {
      refuse(error.what());
    }
  }

private:
  [[nodiscard]] std::string full(const std::string& key) const {
    return path_.empty() ? key : path_ + "." + key;
  }
  [[nodiscard]] std::optional<YAML::Node> find(const std::string& key) const {
    for (const auto& entry : node_)
      if (entry.first.Scalar() == key) return entry.second;
    return std::nullopt;
  }
  [[nodiscard]] YAML::Node required(const std::string& key, const std::string& expected) const {
    const auto found = find(key);
    if (!found) cairn::raise(file_ + ": lacks the field " + full(key) + "; expected " + expected);
    return *found;
  }
  [[nodiscard]] double number(const YAML::Node& node, const std::string& key,
                              const std::string& expected) const {
    const auto value = node.IsScalar() ? cairn::parse_number(node.Scalar()) : std::nullopt;
    if (!value || !std::isfinite(*value))
      refuse("the field " + full(key) + " has '" +
             (node.IsScalar() ? node.Scalar().substr(0, 40) : "a list") +
             "' where a finite number should be; expected " + expected);
    return *value;
  }

  YAML::Node node_;
  std::string file_, path_;
};

void take_matrix(const Fields& fields, const std::string& key, cairn::PinholeParameters& p) {
  const auto k = fields.numbers_of<9>(key, "fx, 0, cx, 0, fy, cy, 0, 0, 1");
  if (k[1] != 0 || k[3] != 0 || k[6] != 0 || k[7] != 0 || k[8] != 1)
    fields.refuse("the field " + key + " is no camera matrix; expected [fx, 0, cx, 0, fy, cy, 0, 0, 1]");
  p.fx = k[0];
  p.cx = k[2];
  p.fy = k[4];
  p.cy = k[5];
}

void take_intrinsics(const Fields& fields, cairn::PinholeParameters& p) {
  const auto k = fields.numbers_of<4>("intrinsics", "fx, fy, cx, cy");
  p.fx = k[0];
  p.fy = k[1];
  p.cx = k[2];
  p.cy = k[3];
}

void take_size(const Fields& fields, const std::string& key, cairn::PinholeParameters& p) {
  const auto size = fields.numbers_of<2>(key, "width, height");
  p.width = fields.side(size[0], key);
  p.height = fields.side(size[1], key);
}

/// One of those that the library has.
std::string lens_model(const Fields& fields) {
  const std::string model = fields.word("distortion_model", "plumb_bob");
  if (model != "plumb_bob" && model != "radtan" && model != "radial-tangential" && model != "none")
    fields.refuse("the lens model '" + model.substr(0, 40) +
                  "' is not supported; expected plumb_bob (also called radtan, radial-tangential) or none");
  return model;
}

/// OpenCV's order; more than five numbers are of models that the library does not have.
void take_distortion(const Fields& fields, const std::string& key, cairn::PinholeParameters& p) {
  const std::string expected = "4 or 5 finite numbers [k1, k2, p1, p2, k3]";
  std::vector<double> d = fields.numbers(key, expected);
  if (std::any_of(d.begin() + static_cast<std::ptrdiff_t>(std::min<std::size_t>(d.size(), 5)), d.end(),
                  [](double one) { return one != 0; }))
    fields.refuse("the field " + key + " has " + std::to_string(d.size()) +
                  " numbers, of a rational, thin-prism or tilted lens, which is not supported; expected " +
                  expected);
  if (d.size() < 4)
    fields.refuse("the field " + key + " has " + std::to_string(d.size()) + " numbers; expected " + expected);
  d.resize(5, 0.0);
  p.k1 = d[0];
  p.k2 = d[1];
  p.p1 = d[2];
  p.p2 = d[3];
  p.k3 = d[4];
}

struct Camera {
  cairn::PinholeCamera camera;
  CameraSigmas sigmas;
};

Camera camera_of(const Fields& fields) {
  fields.expect_only({"image_size", "intrinsics", "camera_matrix", "distortion_model", "distortion",
                      "intrinsics_sigma", "distortion_sigma"});
  cairn::PinholeParameters p;
  take_size(fields, "image_size", p);
  if (fields.has("camera_matrix") && fields.has("intrinsics"))
    fields.refuse("has both intrinsics and camera_matrix; expected one of them");
  if (fields.has("camera_matrix"))
    take_matrix(fields, "camera_matrix", p);
  else
    take_intrinsics(fields, p);
  if (fields.has("distortion_model")) {
    const std::string model = lens_model(fields);
    if (model == "none" && fields.has("distortion"))
      fields.refuse("says that there is no distortion, and has one");
  }
  if (fields.has("distortion")) take_distortion(fields, "distortion", p);
  return {fields.made([&] { return cairn::PinholeCamera(p); }),
          {fields.sigmas_of<4>("intrinsics_sigma", "fx, fy, cx, cy"),
           fields.sigmas_of<5>("distortion_sigma", "k1, k2, p1, p2, k3")}};
}

cairn::SO3 rotation_of(const Fields& fields, const std::string& key) {
  const auto values = fields.numbers_of<9>(key, "a rotation matrix, row by row");
  cairn::Matrix<3> R;
  for (int i = 0; i < 9; ++i) R(i / 3, i % 3) = values[static_cast<std::size_t>(i)];
  return fields.made([&] { return cairn::SO3::from_matrix(R); });
}

cairn::Vector<3> vector_of(const std::array<double, 3>& values) {
  return {values[0], values[1], values[2]};
}

CalibratedRig own_format(const Fields& fields) {
  const std::string version = fields.word("cairn_rig", "the version of the format, 1");
  const auto number = cairn::parse_number<int>(version);
  if (!number || *number < 1)
    fields.refuse("cairn_rig is '" + version.substr(0, 40) + "'; expected the version of the format, 1");
  if (*number > format_version)
    fields.refuse("is of version " + version + " of the format; this program reads version 1");
  fields.expect_only({"cairn_rig", "left", "right", "T_left_right", "note"});
  CalibratedRig result;
  const Camera left = camera_of(fields.part("left")), right = camera_of(fields.part("right"));
  result.left = left.sigmas;
  result.right = right.sigmas;
  const Fields motion = fields.part("T_left_right");
  motion.expect_only({"rotation", "translation", "rotation_sigma", "translation_sigma"});
  result.rig = {
      left.camera, right.camera,
      cairn::SE3(rotation_of(motion, "rotation"), vector_of(motion.numbers_of<3>("translation", "x, y, z")))};
  if (const auto sigmas = motion.sigmas_of<3>("rotation_sigma", "about x, y, z"))
    result.rotation_sigma = vector_of(*sigmas);
  if (const auto sigmas = motion.sigmas_of<3>("translation_sigma", "along x, y, z"))
    result.translation_sigma = vector_of(*sigmas);
  if (fields.has("note")) result.note = fields.word("note", "a sentence");
  return result;
}

cairn::PinholeCamera opencv_camera(const Fields& fields, const std::string& side) {
  cairn::PinholeParameters p;
  take_matrix(fields, "M" + side, p);
  take_distortion(fields, "D" + side, p);
  if (fields.has("image_width") || fields.has("image_height")) {
    const auto length = [&](const std::string& key) {
      const auto value = cairn::parse_number(fields.word(key, "whole pixels"));
      return fields.side(value.value_or(0), key);
    };
    p.width = length("image_width");
    p.height = length("image_height");
  }
  return fields.made([&] { return cairn::PinholeCamera(p); });
}

cairn::PinholeCamera kalibr_camera(const Fields& fields) {
  cairn::PinholeParameters p;
  const std::string projection = fields.word("camera_model", "pinhole");
  if (projection != "pinhole")
    fields.refuse("the camera model '" + projection.substr(0, 40) + "' is not supported; expected pinhole");
  take_size(fields, "resolution", p);
  take_intrinsics(fields, p);
  if (lens_model(fields) != "none") take_distortion(fields, "distortion_coeffs", p);
  return fields.made([&] { return cairn::PinholeCamera(p); });
}

/// A camera chain of Kalibr's (its wiki, "Yaml formats"): T_cn_cnm1 of a camera carries coordinates of the
/// one before to its own. Its other keys are passed over.
CalibratedRig kalibr_format(const Fields& fields) {
  if (fields.has("cam2"))
    fields.refuse("is a chain of more than two cameras; expected cam0 (left) and cam1 (right) alone");
  const Fields left = fields.part("cam0"), right = fields.part("cam1");
  const auto t = right.numbers_of<16>("T_cn_cnm1", "a motion's 4 x 4 matrix, row by row");
  if (t[12] != 0 || t[13] != 0 || t[14] != 0 || t[15] != 1)
    right.refuse("the field T_cn_cnm1 does not end with 0, 0, 0, 1; expected a motion's 4 x 4 matrix");
  cairn::Matrix<3> R;
  R << t[0], t[1], t[2], t[4], t[5], t[6], t[8], t[9], t[10];
  const cairn::SO3 rotation = right.made([&] { return cairn::SO3::from_matrix(R); });
  CalibratedRig result;
  result.rig = {kalibr_camera(left), kalibr_camera(right),
                cairn::SE3(rotation, cairn::Vector<3>(t[3], t[7], t[11])).inverse()};
  return result;
}

CalibratedRig opencv_format(const Fields& fields) {
  if (!fields.has("M1") && !fields.has("R"))
    fields.refuse(
        "is no rig; expected the field cairn_rig (see examples/support/rig_file.hpp), or M1, D1, M2, D2, "
        "R and T of OpenCV's stereo calibration, or cam0 and cam1 of Kalibr's");
  CalibratedRig result;
  const cairn::SE3 T_right_left(rotation_of(fields, "R"), vector_of(fields.numbers_of<3>("T", "x, y, z")));
  result.rig = {opencv_camera(fields, "1"), opencv_camera(fields, "2"), T_right_left.inverse()};
  return result;
}

#endif

void append(std::string& text, const char* name, std::span<const double> values) {
  text += std::string(name) + ": [";
  for (std::size_t i = 0; i < values.size(); ++i) {
    if (i > 0) text += ", ";
    cairn::append_number(text, values[i]);
  }
  text += "]\n";
}

void append_camera(std::string& text, const char* name, const cairn::PinholeCamera& camera,
                   const CameraSigmas& sigmas) {
  const cairn::PinholeParameters& p = camera.parameters();
  text += std::string(name) + ":\n";
  append(text, "  image_size", std::array{1.0 * p.width, 1.0 * p.height});
  append(text, "  intrinsics", std::array{p.fx, p.fy, p.cx, p.cy});
  append(text, "  distortion", std::array{p.k1, p.k2, p.p1, p.p2, p.k3});
  if (sigmas.intrinsics) append(text, "  intrinsics_sigma", *sigmas.intrinsics);
  if (sigmas.distortion) append(text, "  distortion_sigma", *sigmas.distortion);
}

/// A sentence as a YAML word in double quotes.
std::string quoted(const std::string& sentence) {
  std::string text = "\"";
  for (const char letter : sentence) {
    if (letter == '"' || letter == '\\') text += '\\';
    text += static_cast<unsigned char>(letter) < ' ' ? ' ' : letter;
  }
  return text + "\"";
}

}  // namespace

std::optional<double> CalibratedRig::angle_sigma() const {
  if (!rotation_sigma && !translation_sigma) return std::nullopt;
  double largest = rotation_sigma ? rotation_sigma->maxCoeff() : 0;
  if (translation_sigma) {
    // Only across the baseline: its length is no angle.
    const cairn::Vector<3> along = rig.T_left_right.translation() / rig.baseline();
    for (int i = 0; i < 3; ++i)
      largest = std::max(largest, (*translation_sigma)(i)*std::sqrt(std::max(0.0, 1 - along(i) * along(i))) /
                                      rig.baseline());
  }
  return largest;
}

CalibratedRig parse_rig([[maybe_unused]] std::string_view text, const std::string& name) {
#ifdef EXAMPLES_HAVE_YAML
  if (text.size() > most_bytes) cairn::raise(name + ": is larger than a rig can be (1 MiB)");
  std::string yaml(text);
  // OpenCV's heading is not YAML's: a colon stands where YAML has a blank.
  if (yaml.starts_with("%YAML:")) yaml.erase(0, std::min(yaml.find('\n'), yaml.size() - 1) + 1);
  YAML::Node root;
  try {
    root = YAML::Load(yaml);
  } catch (const YAML::Exception& error) {
    cairn::raise(name + ":" + std::to_string(error.mark.line + 1) + ": is no YAML (" + error.msg + ")");
  }
  const Fields fields(root, name, "");
  CalibratedRig result = fields.has("cairn_rig") ? own_format(fields)
                         : fields.has("cam0")    ? kalibr_format(fields)
                                                 : opencv_format(fields);
  const double baseline = result.rig.baseline();
  if (!(baseline > 0) || !std::isfinite(baseline))
    cairn::raise(name + ": the cameras stand at one place; expected a baseline");
  return result;
#else
  cairn::raise(name +
               ": this program was built without yaml-cpp (Debian: libyaml-cpp-dev); a rig file needs it");
#endif
}

CalibratedRig read_rig(const std::filesystem::path& path) {
  return parse_rig(cairn::read_file(path, "a stereo rig (.yaml)"), path.string());
}

std::string rig_text(const CalibratedRig& rig) {
  std::string text =
      "# A stereo rig, for stereo_slam --camera. Pixels, radians, metres; the centre of the first pixel is\n"
      "# (0, 0); T_left_right carries the right camera's coordinates to the left's.\n"
      "cairn_rig: " +
      std::to_string(format_version) + "\n";
  append_camera(text, "left", rig.rig.left, rig.left);
  append_camera(text, "right", rig.rig.right, rig.right);
  text += "T_left_right:\n";
  const cairn::Matrix<3> R = rig.rig.T_left_right.rotation().matrix();
  std::array<double, 9> rows;
  for (int i = 0; i < 9; ++i) rows[static_cast<std::size_t>(i)] = R(i / 3, i % 3);
  append(text, "  rotation", rows);
  const auto of = [](const cairn::Vector<3>& v) { return std::array{v(0), v(1), v(2)}; };
  append(text, "  translation", of(rig.rig.T_left_right.translation()));
  if (rig.rotation_sigma) append(text, "  rotation_sigma", of(*rig.rotation_sigma));
  if (rig.translation_sigma) append(text, "  translation_sigma", of(*rig.translation_sigma));
  if (!rig.note.empty()) text += "note: " + quoted(rig.note) + "\n";
  return text;
}

void write_rig(const std::filesystem::path& path, const CalibratedRig& rig) {
  cairn::write_file_atomically(path, rig_text(rig));
}

}  // namespace example
