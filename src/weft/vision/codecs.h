#pragma once
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace cv {
class Mat;
}

namespace weft {

/// What read_picture() hands over: bytes of one channel; bytes of blue, green and red; the same of
/// as many bits as the file has.
enum class PictureChannels { grey, colour, colour_of_any_depth };

class VideoReader {
 public:
  virtual ~VideoReader() = default;
  /// Blue, green, red; false at the end.
  virtual bool read(cv::Mat& frame) = 0;
  /// Frames a second that the file states; 0 or not finite where it states none.
  virtual double frame_rate() const = 0;
};

class VideoWriter {
 public:
  virtual ~VideoWriter() = default;
  /// Bytes of blue, green and red.
  virtual void write(const cv::Mat& frame) = 0;
};

/// Compressed pictures and videos, by OpenCV: a library of its own that is loaded when it is first
/// asked for. What these two modules of OpenCV bring, 220 libraries of other formats, is nine
/// tenths of the start of a program, and most commands need none of it. All throw cv::Exception
/// where OpenCV does.
class Codecs {
 public:
  /// Empty if it cannot be read.
  virtual cv::Mat read_picture(const std::string& path, PictureChannels channels) const = 0;
  /// In the format that the end of the name says; false if it cannot be written.
  virtual bool write_picture(const std::string& path, const cv::Mat& picture) const = 0;
  /// Bytes of blue, green and red; empty if `bytes` are no picture.
  virtual cv::Mat decode_picture(const std::vector<std::uint8_t>& bytes) const = 0;
  /// As small as can be; false if it cannot be encoded.
  virtual bool encode_png(const cv::Mat& picture, std::vector<std::uint8_t>& bytes) const = 0;
  /// `quality`: 0 to 100.
  virtual bool encode_jpeg(const cv::Mat& picture, int quality,
                           std::vector<std::uint8_t>& bytes) const = 0;
  /// By FFmpeg; null if it cannot be read.
  virtual std::unique_ptr<VideoReader> open_video(const std::string& path) const = 0;
  /// By FFmpeg, `code`: four letters ("avc1", H.264); null if this machine has no such encoder or
  /// it cannot encode this size.
  virtual std::unique_ptr<VideoWriter> create_video(const std::string& path, const char* code,
                                                    double frame_rate, int width,
                                                    int height) const = 0;

 protected:
  ~Codecs() = default;
};

/// Throws Error where the library (libweft_codecs.so: where the program's RUNPATH says, which is
/// beside it in a build, ../lib where it is installed) cannot be loaded.
const Codecs& codecs();

}  // namespace weft
