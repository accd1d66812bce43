package io.github.lazygrid;

import java.io.IOException;
import java.io.InputStream;
import java.io.UncheckedIOException;
import java.nio.file.Files;
import java.nio.file.Path;
import java.nio.file.StandardCopyOption;
import java.util.Locale;

/** Finds the library: named by a property, inside the jar, or installed. */
final class NativeLoader {
    /** A path, or a name for the system to look up. */
    static final String LOCATION = locate();

    private NativeLoader() {}

    private static String locate() {
        String named = System.getProperty("lazygrid.library");
        if (named != null) return Path.of(named).toAbsolutePath().toString();
        String file = System.mapLibraryName("lazygrid");
        try (InputStream inside = NativeLoader.class.getResourceAsStream("/native/" + platform() + "/" + file)) {
            return inside == null ? file : extract(inside, file);
        } catch (IOException error) {
            throw new UncheckedIOException("the library in the jar could not be written to a temporary file", error);
        }
    }

    /** Uses a new folder, because systems load by path, and names may be taken. */
    private static String extract(InputStream inside, String name) throws IOException {
        Path folder = Files.createTempDirectory("lazygrid");
        Path file = folder.resolve(name);
        Files.copy(inside, file, StandardCopyOption.REPLACE_EXISTING);
        // In this order, because the last registered file is deleted first.
        folder.toFile().deleteOnExit();
        file.toFile().deleteOnExit();
        return file.toString();
    }

    /** The system and the processor, such as {@code linux-x86_64}. */
    static String platform() {
        String os = System.getProperty("os.name").toLowerCase(Locale.ROOT);
        String system = os.startsWith("mac") ? "macos" : os.startsWith("windows") ? "windows" : "linux";
        String processor = System.getProperty("os.arch");
        return system + "-" + switch (processor) {
            case "amd64", "x86_64" -> "x86_64";
            case "aarch64", "arm64" -> "aarch64";
            default -> processor;
        };
    }
}
