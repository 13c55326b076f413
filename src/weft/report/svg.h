#pragma once
#include <string>
#include <string_view>

namespace weft {

/// Collects SVG elements, in pixels from the upper left corner. Colours are presentation
/// attributes, which any style sheet of a page overrides by class.
class Svg {
 public:
  /// `class` and further attributes as they stand in the element: `class="grid" stroke="#ddd"`.
  void line(double x1, double y1, double x2, double y2, std::string_view attributes);
  void rect(double x, double y, double width, double height, std::string_view attributes,
            std::string_view tooltip = {});
  void circle(double x, double y, double radius, std::string_view attributes,
              std::string_view tooltip = {});
  void path(std::string_view d, std::string_view attributes, std::string_view tooltip = {});
  /// `content` is escaped here; `y` is the baseline.
  void text(double x, double y, std::string_view attributes, std::string_view content);
  void open(std::string_view attributes);  ///< a group
  void close();
  void raw(std::string_view markup);

  /// The document, with `margin` px added on all sides. `attributes` go to its root element.
  std::string document(double width, double height, double margin, std::string_view title,
                       std::string_view attributes) const;

 private:
  void element(std::string_view start, std::string_view attributes, std::string_view name,
               std::string_view tooltip);
  std::string body_;
};

/// A length in px with at most two decimals: "12", "0.25".
std::string px(double value);

/// Width of `text` in px, about, in a sans-serif face of `size` px. Errs on the wide side.
double text_width(std::string_view text, double size);

}  // namespace weft
