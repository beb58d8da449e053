// SPDX-FileCopyrightText: 2026 The cairn authors
// SPDX-License-Identifier: MIT
//
/// @file
/// A result as one HTML page: key figures on top, then panels with plots, pictures, tables and point clouds.
///
/// The page needs no network: its script and style (report_page/, built with npm) are part of the program,
/// and the numbers are put into it as JSON. Colours carry meaning, see Ink. Values that are not finite leave
/// a gap in a plot.
///
///   example::Report report("Kalman filter", "one run of 400 steps");
///   report.figure({"RMSE", "0.12", "m"});
///   report.add(example::LinePlot{.title = "Error", .x = {"time", "s"}, .y = {"error", "m"}, ...});
///   if (const auto html = report.html()) cairn::write_file_atomically(path, *html);
///   else std::cerr << example::why_no_report() << '\n';
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace example {

/// What a line or a point stands for. Truth is black (white on dark), belief blue, measurement orange, what
/// went wrong red; grey is context, and teal and violet are for quantities of no such role.
enum class Ink { truth, belief, measurement, wrong, grey, teal, violet };

/// A number that sums up the result.
struct KeyFigure {
  enum class Verdict { none, good, bad };
  std::string label;
  std::string value;  ///< as it is to be read: "0.012"
  std::string unit = {};
  std::string hint = {};  ///< a sentence on how it is measured
  Verdict verdict = Verdict::none;
};

/// What an axis measures; the unit may be empty.
struct Axis {
  std::string label = {};
  std::string unit = {};
};

/// One curve over the common x values of a LinePlot.
struct Curve {
  std::string name = {};
  Ink ink = Ink::belief;
  std::vector<double> values = {};  ///< one for each x value
  bool dashed = false;
  bool dots = false;  ///< single ones, such as readings, without a line between them
};

/// The room between two curves over the common x values of a LinePlot, such as a mean and two standard
/// deviations either way.
struct Band {
  std::string name = {};
  Ink ink = Ink::belief;
  std::vector<double> low = {};  ///< one for each x value, and so for `high`
  std::vector<double> high = {};
};

/// Curves over a common axis. The mouse reads values, a dragged range zooms, a double click returns.
struct LinePlot {
  std::string title = {};
  std::string caption = {};
  Axis x = {};
  Axis y = {};
  std::vector<double> x_values = {};  ///< never falling
  std::vector<Curve> curves = {};     ///< none: the panel shows its caption only
  bool logarithmic = false;           ///< the y axis; values that are not positive leave gaps
  bool logarithmic_x = false;         ///< the x axis too; all x values must be positive
  bool wide = false;                  ///< over the whole width of the page
  std::vector<Band> bands = {};       ///< below the curves
};

/// A line through the plane, single dots, or an area. Curves of one name have one entry in the legend, which
/// shows and hides them together.
struct PlaneCurve {
  std::string name = {};
  Ink ink = Ink::belief;
  std::vector<double> x = {};
  std::vector<double> y = {};
  bool dots = false;
  bool dashed = false;
  bool filled = false;  ///< closed, and tinted within
};

/// Where `sigmas` standard deviations about a mean (x, y) end, for the covariance (xx, xy, yy): a closed
/// curve of 48 corners. A covariance with a negative eigenvalue throws cairn::Error naming the curve.
[[nodiscard]] PlaneCurve ellipse(std::string name, Ink ink, const std::array<double, 2>& mean,
                                 const std::array<double, 3>& covariance, double sigmas = 2);

/// A place that is not known exactly: mean (x, y), covariance (xx, xy, yy).
struct PlaneGaussian {
  std::array<double, 2> mean = {};
  std::array<double, 3> covariance = {};
};

/// Ellipses of some places of a path, as one curve.
struct Spreads {
  PlaneCurve curve;  ///< its name says how many sigmas, and how many times as large
  double scale = 1;
};

/// How well a path is known, so that it can be seen: ellipses of `sigmas` standard deviations at places so
/// far apart that they do not cover each other, from the first on, all drawn as many times as large, a number
/// of one digit and zeros, as that allows. Throws as ellipse() does. O(path * ellipses).
[[nodiscard]] Spreads spreads_along(const std::vector<PlaneGaussian>& path, Ink ink, double sigmas = 3);

/// What lies between `low` and `high` over x, as an area. Throws cairn::Error where they are not as many.
[[nodiscard]] PlaneCurve area(std::string name, Ink ink, const std::vector<double>& x,
                              const std::vector<double>& low, const std::vector<double>& high);

/// Curves in a plane: a map, where its two axes have the same scale.
struct PlanePlot {
  std::string title = {};
  std::string caption = {};
  Axis x = {};
  Axis y = {};
  std::vector<PlaneCurve> curves = {};
  bool wide = false;
  bool third = false;  ///< three side by side, where the page has room
  bool equal_scale = true;
  bool downwards = false;  ///< y grows downwards, as the rows of an image do
};

/// One position of a film's slider.
struct PlaneFrame {
  double at = 0;             ///< what the slider measures
  std::string caption = {};  ///< what happens here
  std::vector<PlaneCurve> curves = {};
};

/// Curves in a plane that change along a slider, in one frame for all: moved with the mouse or the arrow
/// keys, or played.
struct PlaneFilm {
  std::string title = {};
  std::string caption = {};
  Axis x = {};
  Axis y = {};
  Axis slider = {};
  std::vector<PlaneCurve> still = {};  ///< drawn at every position
  std::vector<PlaneFrame> frames = {};
  bool equal_scale = true;
  bool wide = false;
  std::optional<std::size_t> start = {};  ///< the frame shown first; by default the last
};

/// A table of numbers as colours. Values that are not finite are grey.
struct HeatMap {
  std::string title = {};
  std::string caption = {};
  Axis x = {};
  Axis y = {};
  Axis value = {};
  std::size_t columns = 0;
  std::size_t rows = 0;
  std::vector<double> values = {};  ///< row by row, the first at the top
  bool diverging = false;           ///< blue below zero, orange above; otherwise dark violet to yellow
  bool wide = false;
};

/// Things drawn over a picture, in its pixels; the reader can hide them by name.
struct Marks {
  std::string name = {};
  Ink ink = Ink::belief;
  std::vector<std::array<float, 2>> points = {};
  std::vector<std::array<float, 4>> segments = {};  ///< from x, y to x, y
};

/// An image of width x height pixels with marks on it.
struct Picture {
  std::string title = {};
  std::string caption = {};
  std::string png = {};  ///< the bytes of a PNG file
  int width = 0;
  int height = 0;
  std::vector<Marks> marks = {};
  bool wide = false;
};

/// One position of a picture film's slider.
struct PictureFrame {
  double at = 0;             ///< what the slider measures
  std::string caption = {};  ///< what happens here
  std::string png = {};      ///< the bytes of a PNG file of the film's size
  std::vector<Marks> marks = {};
};

/// Images of one size with marks that change along a slider: moved with the mouse or the arrow keys, or
/// played. The last is shown first.
struct PictureFilm {
  std::string title = {};
  std::string caption = {};
  Axis slider = {};
  int width = 0;
  int height = 0;
  std::vector<PictureFrame> frames = {};
  bool wide = false;
};

struct Table {
  std::string title = {};
  std::string caption = {};
  std::vector<std::string> columns = {};
  std::vector<std::vector<std::string>> rows = {};
  bool wide = false;
};

/// Values to colour a cloud by.
struct Colouring {
  std::string name = {};
  std::string unit = {};
  std::vector<double> values = {};  ///< one a point
  bool grey = false;                ///< values 0..255 shown as grey levels; otherwise dark violet to yellow
};

/// A line through a cloud.
struct SpaceCurve {
  std::string name = {};
  Ink ink = Ink::belief;
  std::vector<std::array<float, 3>> points = {};
};

/// Points and lines in space, right-handed with z up, turned with the mouse. Points that are not finite are
/// left out.
struct Cloud {
  std::string title = {};
  std::string caption = {};
  std::string unit = {};
  std::vector<std::array<float, 3>> points = {};
  std::vector<Colouring> colourings = {};  ///< the first is shown first
  std::vector<SpaceCurve> curves = {};
  bool wide = false;
};

/// The page being put together; panels appear in the order of adding. A promise of the panels' comments that
/// is broken (values without an x value, say) throws cairn::Error naming the panel.
class Report {
public:
  Report(std::string title, std::string subtitle);

  void figure(KeyFigure figure);
  /// A sentence that the reader should not miss.
  void note(std::string sentence);
  /// The page is one of a growing row and asks its server for the next (live_page.hpp); `version` is at
  /// least 1.
  void live(std::uint64_t version) { live_ = version; }

  void add(const LinePlot& panel);
  void add(const PlanePlot& panel);
  void add(const PlaneFilm& panel);
  void add(const HeatMap& panel);
  void add(const Picture& panel);
  void add(const PictureFilm& panel);
  void add(const Table& panel);
  void add(const Cloud& panel);

  /// Everything as JSON, as the page reads it.
  [[nodiscard]] std::string data() const;

  /// The finished page; nothing where the program was built without the page (see why_no_report).
  [[nodiscard]] std::optional<std::string> html() const;

private:
  std::string title_;
  std::string subtitle_;
  std::vector<KeyFigure> figures_;
  std::vector<std::string> notes_;
  std::vector<std::string> panels_;  // each the text of a JSON object
  std::uint64_t live_ = 0;           // 0: finished
};

/// True where html() gives a page.
[[nodiscard]] bool has_report_page() noexcept;

/// One line that says why there is no report and how to get one.
[[nodiscard]] std::string why_no_report();

/// A number in at most `digits` significant digits, for figures and tables: "0.0123", "1.2e-05"; up to a
/// million all digits before the point, "12345"; "none" where it is not finite.
[[nodiscard]] std::string readable(double value, int digits = 3);

/// A length in the unit that people would say it in: metres, millimetres under a centimetre, micrometres
/// under ten of them. {"1.23", "m"}, {"7.26", "mm"}, {"1.68", "um"}; in words as one text, "7.26 mm".
struct ReadableLength {
  std::string value, unit;
  [[nodiscard]] std::string words() const { return value + " " + unit; }
};
[[nodiscard]] ReadableLength readable_length(double metres);

}  // namespace example
