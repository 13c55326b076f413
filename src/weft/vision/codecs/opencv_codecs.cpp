// The library that codecs() loads.
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/videoio.hpp>

#include "weft/vision/codecs.h"

namespace weft {
namespace {

class OpenCvReader final : public VideoReader {
 public:
  explicit OpenCvReader(const std::string& path) : video_(path, cv::CAP_FFMPEG) {}
  bool is_open() const { return video_.isOpened(); }
  bool read(cv::Mat& frame) override { return video_.read(frame) && !frame.empty(); }
  double frame_rate() const override { return video_.get(cv::CAP_PROP_FPS); }

 private:
  cv::VideoCapture video_;
};

class OpenCvWriter final : public VideoWriter {
 public:
  OpenCvWriter(const std::string& path, int code, double frame_rate, cv::Size size)
      : video_(path, cv::CAP_FFMPEG, code, frame_rate, size) {}
  bool is_open() const { return video_.isOpened(); }
  void write(const cv::Mat& frame) override { video_.write(frame); }

 private:
  cv::VideoWriter video_;
};

int flags_of(PictureChannels channels) {
  switch (channels) {
    case PictureChannels::grey:
      return cv::IMREAD_GRAYSCALE;
    case PictureChannels::colour:
      return cv::IMREAD_COLOR;
    case PictureChannels::colour_of_any_depth:
      break;
  }
  return cv::IMREAD_COLOR | cv::IMREAD_ANYDEPTH;
}

class OpenCvCodecs final : public Codecs {
 public:
  cv::Mat read_picture(const std::string& path, PictureChannels channels) const override {
    return cv::imread(path, flags_of(channels));
  }
  bool write_picture(const std::string& path, const cv::Mat& picture) const override {
    return cv::imwrite(path, picture);
  }
  cv::Mat decode_picture(const std::vector<std::uint8_t>& bytes) const override {
    return bytes.empty() ? cv::Mat() : cv::imdecode(bytes, cv::IMREAD_COLOR);
  }
  bool encode_png(const cv::Mat& picture, std::vector<std::uint8_t>& bytes) const override {
    return cv::imencode(".png", picture, bytes, {cv::IMWRITE_PNG_COMPRESSION, 9});
  }
  bool encode_jpeg(const cv::Mat& picture, int quality,
                   std::vector<std::uint8_t>& bytes) const override {
    return cv::imencode(".jpg", picture, bytes,
                        {cv::IMWRITE_JPEG_QUALITY, quality, cv::IMWRITE_JPEG_OPTIMIZE, 1});
  }
  std::unique_ptr<VideoReader> open_video(const std::string& path) const override {
    auto reader = std::make_unique<OpenCvReader>(path);
    if (!reader->is_open()) return {};
    return reader;
  }
  std::unique_ptr<VideoWriter> create_video(const std::string& path, const char* code,
                                            double frame_rate, int width,
                                            int height) const override {
    const int number = cv::VideoWriter::fourcc(code[0], code[1], code[2], code[3]);
    auto writer = std::make_unique<OpenCvWriter>(path, number, frame_rate, cv::Size(width, height));
    if (!writer->is_open()) return {};
    return writer;
  }
};

}  // namespace
}  // namespace weft

extern "C" const weft::Codecs* weft_codecs() {
  static const weft::OpenCvCodecs codecs;
  return &codecs;
}
